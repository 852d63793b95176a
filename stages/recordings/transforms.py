"""The pose of one frame in another, out of a topic of transforms."""

from typing import Any

from omninav.pipeline.mcap.message import Record

from .messages import TRANSFORMS_TYPE, pose_of
from .pose_topic import PoseTopic
from .recording import UnreadableRecording

MAX_FRAMES = 20
"""Pairs of frames that are named where the wanted one is not there."""


class TransformTopic(PoseTopic):
    """Transforms of `child` in `parent` from a topic (`/tf`), in the order of their own stamps."""

    def __init__(self, name: str) -> None:
        self.name = name
        topic, self.parent, self.child = (*name.split(":"), "", "")[:3]
        super().__init__(topic)
        self._seen: dict[str, None] = {}

    def add_message(self, record: Record, message: Any) -> None:
        """Every transform in it that is meant. Raises ValueError for one that cannot be, as `pose_of`."""
        for each in message.transforms:
            frames = each.header.frame_id.strip("/"), each.child_frame_id.strip("/")
            if frames == (self.parent.strip("/"), self.child.strip("/")):
                at = each.header.stamp
                self.add(at.sec * 1_000_000_000 + at.nanosec, record.log_time, pose_of(each))
            elif len(self._seen) < MAX_FRAMES:
                self._seen[":".join(frames)] = None

    def require(self, log: str, kind: str) -> None:
        """Raise `UnreadableRecording` where there was no such transform, naming those that there were."""
        if kind != TRANSFORMS_TYPE:
            raise UnreadableRecording(
                f"{log}: {self.topic} carries {kind or 'nothing'}, not transforms; truth=/tf:PARENT:CHILD"
            )
        if not len(self):
            known = ", ".join(f"{self.topic}:{pair:.80}" for pair in self._seen) or "none"
            raise UnreadableRecording(f"{log}: no transform {self.name:.80}; type truth= with one of: {known}")

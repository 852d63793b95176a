"""ROS 2 messages as they lie in a log."""

from collections.abc import Collection
from dataclasses import replace

from omninav.pipeline import Value


class RosMessages(Value):
    """The ROS 2 messages that a tick gave, N of them, in their order.

    `topics`, `types` (N,): as text (`nav_msgs/msg/Path`). `data` (N,): their CDR bytes. `stamp`: of the tick (ns).
    `views_every`: of so many ticks one keeps what is only looked at.
    """

    bulky = True

    stamp: int
    topics: tuple[str, ...]
    types: tuple[str, ...]
    data: tuple[bytes, ...]
    views_every: int = 1

    def without(self, topics: Collection[str]) -> "RosMessages":
        """The messages on other topics."""
        kept = [each for each in zip(self.topics, self.types, self.data, strict=True) if each[0] not in topics]
        names, types, data = zip(*kept, strict=True) if kept else ((), (), ())
        return replace(self, topics=names, types=types, data=data)

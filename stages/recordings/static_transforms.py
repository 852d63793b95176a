"""Static transforms (`/tf_static`), and the position of a camera on its robot by them."""

import math
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from omninav.stages.camera.model import FAR_M, Camera
from omninav.stages.geometry.arrays import Array

from .camera_yaml import UNSAID_BY_INFO
from .messages import ImpossiblePose, pose_of

TF_STATIC = "/tf_static"
BASES = ("base_link", "base_footprint")
"""Frames of a robot where odometry names none."""
FLOOR = "base_footprint"
"""Frame of a robot on its floor."""
MAX_LINKS = 100
"""Largest number of transforms between a frame and the root of its tree."""
MAX_Z_M = 20_000.0
"""Largest height of a frame over its parent, m."""
MAX_FRAMES = 10_000
"""Largest number of frames that are kept."""
LEVEL = math.cos(math.radians(20.0))
"""Cosine of the largest lean of a camera: of its axis if it looks up, of its image's vertical if it looks ahead."""
MOVED = 0.01
"""Largest difference between equal transforms: of their translations in m, of their rotations' matrices."""


class Mounted(NamedTuple):
    """A camera, what transforms state of it in words (empty: nothing), and a warning where that does not fit."""

    camera: Camera
    in_words: str = ""
    warning: str = ""

    def unsaid(self, by_info: bool) -> str:
        """The sentence on what is not known of a camera, which a CameraInfo alone may describe; empty where all is."""
        return self.warning or (UNSAID_BY_INFO if by_info and not self.in_words else "")


class StaticTransforms:
    """The last static transform of each frame into its parent."""

    def __init__(self) -> None:
        self._links: dict[str, tuple[str, Array]] = {}
        self._contradicted: set[str] = set()

    def __len__(self) -> int:
        return len(self._links)

    def add(self, message: Any) -> None:
        """All transforms of a TFMessage. Raises ValueError where one of them cannot be, once the others are added."""
        problem = None
        for each in message.transforms:
            at, turn = each.transform.translation, each.transform.rotation
            try:
                child, parent = (name.strip("/") for name in (each.child_frame_id, each.header.frame_id))
                if not child or not parent or child == parent:
                    raise ImpossiblePose(f"a transform of {child!r:.80} in {parent!r:.80}")
                pose_of(each)
                if not abs(at.z) <= MAX_Z_M:
                    raise ImpossiblePose(f"it is {at.z:.1e} m above its parent")
            except ValueError as error:
                problem = error
                continue
            link = np.eye(4)
            link[:3, :3] = Rotation.from_quat([turn.x, turn.y, turn.z, turn.w]).as_matrix()
            link[:3, 3] = at.x, at.y, at.z
            if child in self._links:
                before, earlier = self._links[child]
                if before != parent or np.abs(link - earlier).max() > MOVED:
                    self._contradicted.add(child)
            if child in self._links or len(self._links) < MAX_FRAMES:
                self._links[child] = parent, link
        if problem is not None:
            raise problem

    def between(self, base: str, frame: str) -> Array | None:
        """The pose (4, 4) of a frame in another one; None where no transforms join them."""
        (root, to_base, _), (other, to_frame, _) = self._to_root(base), self._to_root(frame)
        if not root or root != other:
            return None
        return np.linalg.inv(to_base) @ to_frame

    def scanner(self, base: str, frame: str) -> Array | None:
        """The pose (4, 4) of a frame on the robot, whose own is `base`; None where no transforms join them."""
        return next((pose for _, pose in self._on_robot(base, frame)), None)

    def _on_robot(self, base: str, frame: str) -> list[tuple[str, Array]]:
        """The frames of a robot to which transforms join one, each with its pose there."""
        bases = base.strip("/"), *BASES
        return [(name, pose) for name in bases if (pose := self.between(name, frame.strip("/"))) is not None]

    def _to_root(self, frame: str) -> tuple[str, Array, set[str]]:
        """The root of a frame's tree ("" for one that is its own ancestor), its pose there, and the frames between."""
        pose, passed = np.eye(4), set[str]()
        while frame in self._links:
            if frame in passed or len(passed) == MAX_LINKS:
                return "", pose, passed
            passed.add(frame)
            frame, link = self._links[frame]
            pose = link @ pose
        return frame, pose, passed

    def mounted(self, camera: Camera, base: str, frame: str, by_info: bool) -> Mounted:
        """The camera with its position on the robot where it has none and, where a CameraInfo alone describes it
        (`by_info`), its yaw and its height over `base_footprint`.

        `base`: the robot's frame as odometry names it. `frame`: the camera's, by REP 103 with x to the right in the
        image, y down and z along the optical axis.
        """
        frame, joined = frame.strip("/"), self._on_robot(base, frame)
        if not joined or frame in (base.strip("/"), *BASES) or (not by_info and camera.placed):
            return Mounted(camera)
        name, pose = joined[0]
        if np.abs(pose[:2, 3]).max() > FAR_M:
            return Mounted(camera)
        unsure = sorted(self._contradicted & (self._to_root(frame)[2] ^ self._to_root(name)[2]))
        warning = f"{TF_STATIC} gives {unsure[0]!r:.80} more than one pose; the last is taken" if unsure else ""
        x, y = (round(float(value), 6) + 0.0 for value in pose[:2, 3])
        where = f"x {x:.3f}, y {y:.3f} m in {name}, by {TF_STATIC}"
        camera = replace(camera, position_x=x, position_y=y)
        if not by_info:
            return Mounted(camera, where, warning)
        floor = self.between(FLOOR, frame)
        if floor is not None and 0.0 < floor[2, 3] <= FAR_M:
            camera = replace(camera, height=round(float(floor[2, 3]), 6))
        up, ahead = pose[2, 2] > LEVEL, -pose[2, 1] > LEVEL
        if not up and (camera.ring is not None or not ahead):
            part, looks, upright = (
                ("image", "ahead", -pose[2, 1]) if camera.ring is None else ("axis", "up", pose[2, 2])
            )
            leans = math.degrees(math.acos(np.clip(upright, -1.0, 1.0)))
            leaning = f"by {TF_STATIC} its {part} is {leans:.0f} degrees off the vertical, expected a camera that looks"
            return Mounted(camera, where, f"{leaning} {looks}; its yaw is taken to be 0: give camera=PATH/camera.yaml")
        axis = 0 if up else 2
        yaw = round(math.atan2(pose[1, axis], pose[0, axis]), 6)
        return Mounted(replace(camera, yaw=yaw), f"{where}, turned by {math.degrees(yaw):.1f} degrees", warning)

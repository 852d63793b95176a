"""Homing to where an image was taken: the target image, the homing vector, the progress along a path of images."""

import math
from dataclasses import field, replace
from typing import Annotated, Literal

import numpy as np

from omninav.pipeline import Bounds, Shape, Value
from omninav.stages.geometry.arrays import Array, Ints
from omninav.stages.geometry.plane.se2 import compose
from omninav.stages.geometry.two_views.epipolar import turn_about_vertical

from .local_features import LocalFeatures
from .pose import Motion

Finite = Annotated[float, Bounds(ge=-1e15, le=1e15)]


class ImagePath(Value):
    """Views to go to one after the other. `number`: a new path has a new one. `views`: their features, in order.

    The robot stops at the last, with the heading in which that was taken. `names` (one for each): what they are called.
    """

    number: int
    views: tuple[LocalFeatures, ...]
    names: tuple[str, ...]


class HomingTarget(Value):
    """The view to go to now. `number`: another target has another. `last`: the path ends there."""

    number: int
    features: LocalFeatures
    last: bool = True
    name: str = ""


class HomingVector(Value):
    """Pose of the target view, seen from the robot.

    `direction`: where to go (rad, counter-clockwise from forward); `turn`: how far to turn, in all, to have the
    target's heading (rad, counter-clockwise). `distance`: in units of the first baseline, the way from where the local
    map was made (erratum 39 in docs/papers.md: bearings alone give no metres); `ratio`: over the way from where homing
    towards this target began, the same unless the map was made again. `depth_ratio`: the distance over a typical
    feature's, small where the two views hardly differ. `metres`: the distance, where odometry has told the unit.
    `inliers`: features that agree with it. `state`: `new` (from two views), `tracking` (from the local map), `doubtful`
    (from two views, and no other image has confirmed yet that they show one place), or `lost`; of the last two `why`.
    Values of a lost target are those known last, moved on by odometry where there is any.
    """

    number: int
    direction: Finite
    turn: Finite
    distance: Finite
    ratio: Finite
    depth_ratio: Finite
    metres: Annotated[float | None, Bounds(ge=0)]
    inliers: Annotated[int, Bounds(ge=0)]
    state: Literal["new", "tracking", "doubtful", "lost"]
    why: str = ""

    @property
    def is_found(self) -> bool:
        """Tells that the target is known well enough to rely on it."""
        return self.state in ("new", "tracking")


LOST, TRACKED, FOUND_AGAIN, MATCHED = range(4)
"""Kinds of features in `TrackedFeatures` and `LocalMap`."""


class TrackedFeatures(Value):
    """Features of the local map with this `number` in the present image, N of them.

    `rows` (N,): which of the target's points they are. `kinds` (N,): LOST, TRACKED, FOUND_AGAIN (tracked from where
    it was found again in the image before), MATCHED (not tracked, but matched with the target view). `points` (N, 2):
    columns and rows, pixels of the image; of lost ones where they should be, NaN where that is outside of it.
    `bearings` (N, 3): unit vectors in the robot's frame, and `places` (N, 3): positions in the local map of what is
    tracked, which is beside the feature.
    """

    number: int
    rows: Annotated[Ints, Shape("N"), Bounds(ge=0)]
    kinds: Annotated[Ints, Shape("N")]
    points: Annotated[Array, Shape("N", 2, finite=False)]
    bearings: Annotated[Array, Shape("N", 3, finite=False)]
    places: Annotated[Array, Shape("N", 3, finite=False)]


class LocalMap(Value):
    """Features around the robot, with the robot and the target view among them.

    The frame is the robot's where the map was made, the unit the distance from there to the target. `number`: another
    map has another; `target`: the number of the target it leads to. `state`: `new` (made of two views in this tick),
    `tracking`, `doubtful` (as a `HomingVector` is), or `lost`, and of the last two `why`; a lost map without features
    is no map.

    `rows` (N,): the target's points; `places` (N, 3): where they are; `kinds` (N,): as in `TrackedFeatures`, LOST
    where a track contradicts the robot's pose; `points` (N, 2): pixels of MATCHED ones in the image.
    `rotation` (3, 3), `translation` (3,): the robot's pose; `goal_rotation`, `goal_translation`: the target's.
    `inliers`: features that agree with the robot's pose; `first_inliers`: those that agreed when the map was made.
    `unit`: in units of the first baseline of this target. `metres`: the same by odometry, 0 where it is not known.
    `odometry` (3,): since the map was made (m, m, rad).
    """

    number: int
    target: int
    state: Literal["new", "tracking", "doubtful", "lost"]
    inliers: int = 0
    why: str = ""
    rows: Annotated[Ints, Shape("N"), Bounds(ge=0)] = field(default_factory=lambda: np.zeros(0, np.int64))
    places: Annotated[Array, Shape("N", 3)] = field(default_factory=lambda: np.zeros((0, 3)))
    kinds: Annotated[Ints, Shape("N")] = field(default_factory=lambda: np.zeros(0, np.int64))
    points: Annotated[Array, Shape("N", 2, finite=False)] = field(default_factory=lambda: np.zeros((0, 2)))
    rotation: Annotated[Array, Shape(3, 3)] = field(default_factory=lambda: np.eye(3))
    translation: Annotated[Array, Shape(3)] = field(default_factory=lambda: np.zeros(3))
    goal_rotation: Annotated[Array, Shape(3, 3)] = field(default_factory=lambda: np.eye(3))
    goal_translation: Annotated[Array, Shape(3)] = field(default_factory=lambda: np.zeros(3))
    first_inliers: int = 0
    unit: float = 1.0
    metres: float = 0.0
    odometry: Annotated[Array, Shape(3)] = field(default_factory=lambda: np.zeros(3))

    def __len__(self) -> int:
        return len(self.rows)

    def depth(self) -> float:
        """Typical distance of the features from the robot."""
        return float(np.median(np.linalg.norm(self.places - self.translation, axis=1)))

    def to_target(self) -> Array:
        """Vector from the robot to the place of the target view, in the robot's frame: (3,)."""
        return np.asarray(self.rotation.T @ (self.goal_translation - self.translation))

    def distance(self) -> float:
        """Over the floor to where the target view was taken."""
        return math.hypot(*self.to_target()[:2])

    def moved(self, motion: Motion | None) -> "LocalMap":
        """The map after a motion increment; the robot's position moves only where the unit in metres is known."""
        if motion is None:
            return self
        translation = self.translation
        if self.metres > 0.0:
            translation = translation + self.rotation @ np.array([motion.x, motion.y, 0.0]) / self.metres
        return replace(
            self,
            odometry=compose(self.odometry, (motion.x, motion.y, motion.turn)),
            rotation=self.rotation @ turn_about_vertical(motion.turn),
            translation=translation,
        )


class PathProgress(Value):
    """Progress of the robot along an image path: `at` of `of` views reached. `path`: the path's number.

    `target`: the number of the view it goes to now, `last` where the path ends there. `docking`: it is where that was
    taken, and has only to turn; `arrived`: it has turned.
    """

    path: int
    at: int
    of: int
    target: int
    last: bool
    docking: bool
    arrived: bool


class DrivingStatus(Value):
    """Action of a robot that follows a homing vector, and why it does not do more.

    `waiting`: it has no target; `driving`; `docking`: it turns to the last view's heading; `arrived`; `lost`: it does
    not know where the target is; `blocked`: there is no way through what is around it.
    """

    state: Literal["waiting", "driving", "docking", "arrived", "lost", "blocked"]
    why: str = ""

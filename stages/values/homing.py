"""Going where a picture was taken: which picture, where that was, how far along a path of pictures the robot is."""

from typing import Literal

import numpy as np
import numpy.typing as npt

from omninav.pipeline import Value

from .local_features import LocalFeatures

Array = npt.NDArray[np.float64]


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
    """Where the target view was taken, seen from the robot.

    `direction`: where to go (rad, counter-clockwise from forward); `turn`: how far to turn, in all, to have the
    target's heading (rad, counter-clockwise). `distance`: in units of the first baseline, the way from where the local
    map was made (erratum 39: bearings alone give no metres); `ratio`: over the way from where homing towards this
    target began, the same unless the map was made anew. `nearness`: the distance over that of a typical feature; small
    where the two views hardly differ, from the first tick on. `metres`: the distance, where odometry has told the
    unit. `inliers`: features that agree with it. `state`: `new` (from two views), `tracking` (from the local map), or
    `lost`, and then `why`; what is said of a lost target is what was known last, moved on by odometry where there is
    any.
    """

    number: int
    direction: float
    turn: float
    distance: float
    ratio: float
    nearness: float
    metres: float | None
    inliers: int
    state: Literal["new", "tracking", "lost"]
    why: str = ""


class TrackedFeatures(Value):
    """The features of the local map in the present picture, for people to look at.

    `points` (N, 2): columns and rows, pixels of the picture; of lost ones, where they should be, NaN where that is
    outside of it. `kinds` (N,): 0 lost, 1 tracked, 2 found again, 3 matched anew with the target view. `rows` (N,):
    which of the target's features they are.
    """

    points: Array
    kinds: npt.NDArray[np.int64]
    rows: npt.NDArray[np.int64]


class PathProgress(Value):
    """How far along an image path the robot is: `at` of `of` views reached. `path`: the path's number.

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
    """What a robot that follows a homing vector does, and why it does not do more.

    `waiting`: it has no target; `driving`; `docking`: it turns to the last view's heading; `arrived`; `lost`: it does
    not know where the target is; `blocked`: there is no way through what stands around it.
    """

    state: Literal["waiting", "driving", "docking", "arrived", "lost", "blocked"]
    why: str = ""

"""Tells how far a robot may have been carried between two images, and whether these are of one place."""

import math
from typing import NamedTuple

import numpy as np

from omninav.stages.geometry.appearance.feature_matching import mutual_nearest_units
from omninav.stages.geometry.appearance.visual_words import root_descriptors
from omninav.stages.geometry.arrays import Array, Bytes
from omninav.stages.geometry.two_views.epipolar import turn_about_vertical

from .map_making import RATIO, fit_motion

TOLERANCE = math.radians(1.0)
"""Angle of a bearing to the plane of the motion and the other bearing, above which a match does not fit (rad)."""
TURNS = np.radians(np.arange(-6.0, 7.0))
"""Errors of a turn that are tried (rad)."""
STANDING_M = 0.02
"""Way below which only the turn counts (m)."""
SAME_PLACE_TOLERANCE = math.radians(2.0)
"""Angle by which bearings from one place may differ, but for a turn (rad): of 50 pairs of images of two offices on two
days 50 fit from 2 cm apart and 49 from 8 cm, 12 from 20 cm, and none from 0.5, 1 or 2 m."""
MIN_FITTING, MIN_SHARE = 25, 0.5
"""Matches that must fit odometry's motion, and their share, of a robot that was not carried. Of images in a row 99 %
and more have them (a house, two offices, a store), of images 1 to 3 m from where odometry has them 0 to 7 %."""
SAME_SURROUNDINGS, SURROUNDINGS_M = 40, 5.0
"""Matches that two images of the same surroundings have, and how far off these were taken at most (m): of images in a
row 98 % have 50 and more, also where the camera was lifted; of images more than 3 m off 98 % have fewer than 24."""
SAME_HEADING = 0.7
"""Mean cosine of the turns of their matches against odometry's, above which the robot was not turned."""
MIN_FEATURES, MIN_MATCHED = 100, 0.15
"""Fewest features of both images for a judgement, and the share of them that match, below which surroundings differ,
with fewer than `SAME_SURROUNDINGS` matches too: so had one of 2,831 images in a row (a house, offices, stores, game
levels, grass), and 98 to 100 % of images 1.5 m and more apart (docs/experiments/landmarks.md)."""
MAX_FITTING = 15
"""Matches that fit odometry's motion, from which on two images are of the same surroundings however few match: in a
narrow aisle 21 of 31 of two images 0.45 m apart did; of 2,367 images 1.5 m and more apart 99 % have fewer."""


class Carried(NamedTuple):
    """A bound, `at_most`, of how far (m) from odometry's pose a robot was carried, whether it `surely` was, and by
    how much it was `turned` otherwise (rad)."""

    at_most: float
    surely: bool = False
    turned: float = 0.0


def carried(before: tuple[Array, Bytes], now: tuple[Array, Bytes], motion: Array) -> Carried:
    """Compares an image with the one before; what continues it was not carried.

    Of both: bearings (N, 3) and descriptors (N, D); `motion` (3,) between them.
    """
    pairs = mutual_nearest_units(root_descriptors(before[1]), root_descriptors(now[1]), RATIO)
    first = np.ascontiguousarray(before[0][pairs.first])
    second = np.ascontiguousarray(now[0][pairs.second])
    fitting = _fitting_at_best(first, second, motion, TOLERANCE)
    if _fits(fitting, len(first)):
        return Carried(0.0)
    if len(first) < SAME_SURROUNDINGS and fitting < MAX_FITTING:
        seen = min(len(before[0]), len(now[0]))
        return Carried(math.inf, seen >= MIN_FEATURES and len(first) < MIN_MATCHED * seen)
    azimuths = [np.arctan2(each[:, 1], each[:, 0]) for each in (first, second)]
    turned = np.exp(1j * (azimuths[1] - azimuths[0] + motion[2])).mean()  # of far points: the turn odometry missed
    if turned.real <= SAME_HEADING:
        return Carried(math.inf)
    return Carried(SURROUNDINGS_M, turned=abs(float(np.angle(turned))))


def of_one_place(one: tuple[Array, Bytes], other: tuple[Array, Bytes], turn: float) -> bool:
    """Tells whether two images were taken within a decimetre or two, the other one turned by `turn` (rad)."""
    pairs = mutual_nearest_units(root_descriptors(one[1]), root_descriptors(other[1]), RATIO)
    first, second = np.ascontiguousarray(one[0][pairs.first]), np.ascontiguousarray(other[0][pairs.second])
    return _fits(_fitting_at_best(first, second, np.array([0.0, 0.0, turn]), SAME_PLACE_TOLERANCE), len(first))


def _fits(fitting: int, matches: int) -> bool:
    return fitting >= max(MIN_FITTING, MIN_SHARE * matches)


def _fitting_at_best(first: Array, second: Array, motion: Array, tolerance: float) -> int:
    """Number of pairs of bearings (M, 3) that fit a motion (3,), but for an error of its turn."""
    return max(_fitting(first, second, motion + np.array([0.0, 0.0, by]), tolerance) for by in TURNS)


def _fitting(first: Array, second: Array, motion: Array, tolerance: float) -> int:
    if math.hypot(motion[0], motion[1]) > STANDING_M:
        return int(np.count_nonzero(fit_motion(first, second, motion, tolerance)))
    turned = second @ turn_about_vertical(float(motion[2])).T
    return int(np.count_nonzero(np.einsum("mi,mi->m", first, turned) > math.cos(tolerance)))

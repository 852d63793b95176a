"""Which references of a map are worth comparing, and whether they can be compared at all."""

import math
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.spatial import KDTree

from omninav.pipeline.problems import BadInput
from omninav.stages.values.belief import Particles
from omninav.stages.values.features import SegmentFeatures, SegmentHistograms
from omninav.stages.values.maps import ReferenceGraph

Array = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]

GOLDEN = (math.sqrt(5.0) - 1.0) / 2.0
"""Multiples of it, less their whole part, fill an interval evenly from the first on."""


class Candidates(NamedTuple):
    """References to compare: their indices, ascending, and how many of the map's each stands for.

    Both None: all of them, each for itself.
    """

    chosen: Ints | None = None
    stands_for: Array | None = None


def near_belief(
    poses: Array, near: Particles | None, radius: float, whole: int, strangers: int, turn: int
) -> Candidates:
    """The references within `radius` metres of any particle, and `strangers` of the others.

    Strangers are taken at equal steps along the map, others at each `turn`, so that all of them have their turn; each
    stands for as many as the step is long, and sums with `stands_for` are unbiased for the whole map. All references
    are compared where there is no belief, where `radius` is 0, where none is near, and where there are at most `whole`.
    """
    if near is None or radius <= 0.0 or len(poses) <= whole:
        return Candidates()
    places = np.floor(near.poses[:, :2] / (radius / 2)).astype(np.int64)
    low = places.min(axis=0)
    height = int(places[:, 1].max() - low[1]) + 1
    numbers = np.unique((places[:, 0] - low[0]) * height + places[:, 1] - low[1])  # far faster than unique rows
    cells = np.column_stack([numbers // height, numbers % height]) + low
    if len(cells) > len(poses):
        return Candidates()
    # A particle lies within radius / 2 * sqrt(1/2) of its cell's centre: the reach grows by that much.
    reach = radius * (1.0 + math.sqrt(0.5) / 2)
    tree: Any = KDTree((cells + 0.5) * (radius / 2))  # type: ignore[no-untyped-call]
    near_any = np.isfinite(tree.query(poses[:, :2], distance_upper_bound=reach)[0])
    others = np.flatnonzero(~near_any)
    if len(others) == len(poses) or len(others) <= strangers:
        return Candidates()
    stands_for = near_any.astype(np.float64)
    if strangers:
        step = len(others) / strangers
        first = (turn * GOLDEN % 1.0) * step
        taken = np.minimum((first + step * np.arange(strangers)).astype(np.int64), len(others) - 1)
        stands_for[others[taken]] = step
    chosen = np.flatnonzero(stands_for)
    return Candidates(chosen, stands_for[chosen])


def check_alike(features: SegmentFeatures, map: ReferenceGraph) -> bool:
    """Whether view and map are histograms (else colours). Raises BadInput where they do not describe views alike."""
    histograms = isinstance(features, SegmentHistograms)
    kind = "histograms" if histograms else "colours"
    shape = tuple(map.features.shape[1:])
    if len(map) and (map.kind != kind or shape != features.values.shape):
        raise BadInput(
            f"map: its views are {map.kind} of {shape[0]} segments x {shape[1]} bins, the present one is {kind} of "
            f"{features.values.shape[0]} x {features.values.shape[1]}; learn the map anew with these features"
        )
    return histograms

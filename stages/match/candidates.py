"""Which references of a map are worth comparing, and whether they can be compared at all."""

import math
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.spatial import KDTree

from omninav.pipeline.problems import BadInput
from omninav.stages.values.belief import Particles
from omninav.stages.values.features import SegmentFeatures, SegmentHistograms
from omninav.stages.values.maps import ReferenceGraph

Ints = npt.NDArray[np.int64]


STRANGERS = 64
"""References compared wherever the belief is, spread evenly over the map: what "alike" is worth is judged by them."""


def near_belief(poses: npt.NDArray[np.float64], near: Particles | None, radius: float, whole: int = 0) -> Ints | None:
    """Indices of the references to compare, ascending; None for all of them.

    Those within `radius` metres of any particle, and `STRANGERS` spread over the map. All are compared where there is
    no belief, where `radius` is 0, where none is near, and where there are at most `whole` references.
    """
    if near is None or radius <= 0.0 or len(poses) <= whole:
        return None
    places = np.floor(near.poses[:, :2] / (radius / 2)).astype(np.int64)
    low = places.min(axis=0)
    height = int(places[:, 1].max() - low[1]) + 1
    numbers = np.unique((places[:, 0] - low[0]) * height + places[:, 1] - low[1])  # far faster than unique rows
    cells = np.column_stack([numbers // height, numbers % height]) + low
    if len(cells) > len(poses):
        return None
    # A particle lies within radius / 2 * sqrt(1/2) of its cell's centre: the reach grows by that much.
    reach = radius * (1.0 + math.sqrt(0.5) / 2)
    tree: Any = KDTree((cells + 0.5) * (radius / 2))  # type: ignore[no-untyped-call]
    near_any = np.isfinite(tree.query(poses[:, :2], distance_upper_bound=reach)[0])
    if not near_any.any():
        return None
    near_any[np.linspace(0, len(poses) - 1, min(STRANGERS, len(poses))).astype(np.int64)] = True
    return None if near_any.all() else np.flatnonzero(near_any)


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

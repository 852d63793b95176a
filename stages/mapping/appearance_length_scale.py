"""Measures the appearance length scale of a finished map."""

import math
from typing import Annotated, Any

import numpy as np
import numpy.typing as npt

from omninav.pipeline import Bounds, Context, Outputs, Stage
from omninav.stages.geometry.appearance.segments import MAX_DISTANCES, similarities
from omninav.stages.geometry.plane.se2 import wrap
from omninav.stages.values.length_scale import LengthScale
from omninav.stages.values.maps import ReferenceGraph

Array = npt.NDArray[np.float64]

MAX_COMPARED, NEAREST_COMPARED = 10_000, 1000
"""References with which a sample is compared, and how many of them, in a larger map, are those nearest to it."""


def excess_by_distance(distances: Array, similarity: Array, bins: int = 30) -> tuple[Array, Array]:
    """The excess similarity of views over their distance: bin centres (B,) in metres and means (B,).

    `distances` (samples, references): from each sample view to all references, 0 to itself; `similarity`, the same
    shape, NaN where views are not to be compared. The median over the references is a sample's background: the excess
    is (S - median) / (1 - median), 1 at its own place. Bins have equal ratios of distance and hold at
    least five pairs.
    """
    background = np.nanmedian(similarity, axis=1, keepdims=True)
    excess = ((similarity - background) / np.maximum(1.0 - background, 1e-9)).ravel()
    gaps = distances.ravel()
    compared = (gaps > 1e-6) & np.isfinite(excess)
    excess, gaps = excess[compared], gaps[compared]
    if not len(gaps):
        return np.zeros(0), np.zeros(0)
    edges = np.geomspace(max(gaps.min(), gaps.max() / 1000), gaps.max() * (1 + 1e-9), bins + 1)
    which = np.digitize(gaps, edges) - 1
    inside = (which >= 0) & (which < bins)
    counts = np.bincount(which[inside], minlength=bins)
    sums = np.bincount(which[inside], excess[inside], minlength=bins)
    full = counts >= 5
    return np.sqrt(edges[:-1] * edges[1:])[full], sums[full] / counts[full]


def compared_with(poses: Array, samples: npt.NDArray[np.int64]) -> npt.NDArray[np.int64] | None:
    """With which references each of the samples (S,) of a large map is compared: (S, C). None: with all of them.

    Those nearest to it, for the similarity over short distances, and more of them evenly over the map, for the
    background.
    """
    if len(poses) <= MAX_COMPARED:
        return None
    from scipy.spatial import KDTree  # slow to import, and seldom needed

    tree: Any = KDTree(poses[:, :2])
    near = tree.query(poses[samples, :2], k=NEAREST_COMPARED)[1]
    even = np.linspace(0, len(poses) - 1, MAX_COMPARED - NEAREST_COMPARED).astype(np.int64)
    return np.concatenate([near, np.broadcast_to(even, (len(samples), len(even)))], axis=1)


def length_scale_of(
    map: ReferenceGraph,
    samples: int = 40,
    share: float = 0.5,
    headings: int = 36,
    max_heading_difference: float = math.radians(30.0),
    min_references: int = 10,
) -> float | None:
    """The distance (m) at which a map's views keep `share` of their excess similarity; None where none can be measured.

    The parameters are those of `AppearanceLengthScale`; `max_heading_difference` in radians.
    """
    if len(map) < min_references:
        return None
    chosen = np.unique(np.linspace(0, len(map) - 1, min(samples, len(map))).astype(np.int64))
    histograms, scale = map.kind == "histograms", MAX_DISTANCES[map.kind]
    others = compared_with(map.poses, chosen)
    views = map.features[:] if others is None else None
    similarity = np.stack(
        [
            similarities(
                map.features[rows] if views is None else views,
                map.features[n],
                headings,
                histograms,
                False,
                0.0,
                max_distance=scale,
            ).max(axis=1)
            for n, rows in zip(chosen, chosen if others is None else others, strict=True)
        ]
    ).astype(np.float64)
    gap = map.poses[chosen, None] - (map.poses if others is None else map.poses[others])
    if map.features.shape[1] == 1:
        similarity[np.abs(wrap(gap[..., 2])) > max_heading_difference] = np.nan
    centres, excess = excess_by_distance(np.hypot(gap[..., 0], gap[..., 1]), similarity)
    below = np.flatnonzero(excess < share)
    if not len(centres):
        return None
    return float(centres[below[0]] if len(below) else centres[-1])


class AppearanceLengthScale(Stage):
    """Measures the distance at which the map's views have lost half of their excess similarity, a correlation length.

    Not in the paper, whose maps are all of one store: it replaces thresholds in metres. Sample references are compared
    with all others at all headings by their mean segment similarity. Views of one segment, which look one way, are
    compared only with those of about the same heading. Manifest fact `appearance_length_scale_m`.
    """

    samples: Annotated[int, Bounds(ge=1)] = 40
    """References, spread evenly over the map, that are compared with all others."""
    share: Annotated[float, Bounds(gt=0, lt=1)] = 0.5
    """Excess similarity left at the length scale."""
    headings: Annotated[int, Bounds(ge=1)] = 36
    """Headings at which views are compared."""
    max_heading_difference_deg: Annotated[float, Bounds(gt=0, le=180)] = 30.0
    """Difference of heading up to which views of one segment are compared, about half of the field of view."""
    min_references: Annotated[int, Bounds(ge=2)] = 10
    """References a map needs to be measured."""
    default_m: Annotated[float, Bounds(gt=0)] = 0.5
    """Length scale of a map that cannot be measured."""

    class Out(Outputs):
        """The length scale of the map's views."""

        length_scale: LengthScale

    def step(self, ctx: Context, map: ReferenceGraph) -> Out:
        """Measure one map."""
        limit = math.radians(self.max_heading_difference_deg)
        metres = length_scale_of(map, self.samples, self.share, self.headings, limit, self.min_references)
        metres = self.default_m if metres is None else metres
        ctx.fact("appearance_length_scale_m", round(metres, 3))
        return self.Out(length_scale=LengthScale(metres))

"""How far the look of a place reaches, measured on a finished map."""

import math
from typing import Annotated

import numpy as np
import numpy.typing as npt

from omninav.pipeline import Bounds, Context, Outputs, Stage
from omninav.stages.geometry.appearance.segments import similarities
from omninav.stages.geometry.plane.se2 import wrap
from omninav.stages.values.length_scale import LengthScale
from omninav.stages.values.maps import ReferenceGraph

Array = npt.NDArray[np.float64]


def excess_by_distance(distances: Array, alike: Array, bins: int = 30) -> tuple[Array, Array]:
    """How much more alike than strangers views are, by their distance: bin centres (B,) in metres and means (B,).

    `distances` (samples, references) from each sample view to all references, 0 to itself; `alike`, the same shape,
    their similarities, NaN where they are not to be compared. A sample's strangers are its median reference: the excess
    is (S - median) / (1 - median), 1 at its own place. Bins are equal ratios of distance and hold five pairs at least.
    """
    strangers = np.nanmedian(alike, axis=1, keepdims=True)
    excess = ((alike - strangers) / np.maximum(1.0 - strangers, 1e-9)).ravel()
    apart = distances.ravel()
    compared = (apart > 1e-6) & np.isfinite(excess)
    excess, apart = excess[compared], apart[compared]
    if not len(apart):
        return np.zeros(0), np.zeros(0)
    edges = np.geomspace(max(apart.min(), apart.max() / 1000), apart.max() * (1 + 1e-9), bins + 1)
    which = np.digitize(apart, edges) - 1
    inside = (which >= 0) & (which < bins)
    counts = np.bincount(which[inside], minlength=bins)
    sums = np.bincount(which[inside], excess[inside], minlength=bins)
    full = counts >= 5
    return np.sqrt(edges[:-1] * edges[1:])[full], sums[full] / counts[full]


class AppearanceLengthScale(Stage):
    """The distance at which the map's own views have lost half of their excess similarity.

    Not in the paper, whose maps are all of one store; it replaces thresholds in metres by one that is measured on each
    map. `samples` references, spread evenly over the map, are compared with all others at all headings by their mean
    segment similarity. Views of one segment, pictures that look one way, only with those that look the same way to
    `alike_deg`, half of a picture's field: of one place, too, pictures that look other ways are strangers. `share` of
    the excess that is left there. A map of fewer than `least` references has nothing to measure: then `otherwise_m`.
    """

    samples: Annotated[int, Bounds(ge=1)] = 40
    share: Annotated[float, Bounds(gt=0, lt=1)] = 0.5
    headings: Annotated[int, Bounds(ge=1)] = 36
    alike_deg: Annotated[float, Bounds(gt=0, le=180)] = 30.0
    least: Annotated[int, Bounds(ge=2)] = 10
    otherwise_m: Annotated[float, Bounds(gt=0)] = 0.5

    class Out(Outputs):
        """`reach` of the map's views."""

        length_scale: LengthScale

    def step(self, ctx: Context, map: ReferenceGraph) -> Out:
        """Measure one map."""
        metres = self._measured(map)
        ctx.fact("view_reach_m", round(metres, 3))
        return self.Out(length_scale=LengthScale(metres))

    def _measured(self, map: ReferenceGraph) -> float:
        if len(map) < self.least:
            return self.otherwise_m
        chosen = np.unique(np.linspace(0, len(map) - 1, min(self.samples, len(map))).astype(np.int64))
        histograms = map.kind == "histograms"
        alike = np.stack(
            [
                similarities(map.features, map.features[n], self.headings, histograms, False, 0.0).max(axis=1)
                for n in chosen
            ]
        ).astype(np.float64)
        gap = map.poses[chosen, None] - map.poses
        if map.features.shape[1] == 1:
            alike[np.abs(wrap(gap[..., 2])) > math.radians(self.alike_deg)] = np.nan
        centres, excess = excess_by_distance(np.hypot(gap[..., 0], gap[..., 1]), alike)
        below = np.flatnonzero(excess < self.share)
        if not len(centres):
            return self.otherwise_m
        return float(centres[below[0]] if len(below) else centres[-1])

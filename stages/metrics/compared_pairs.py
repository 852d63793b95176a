"""Accuracy with which the comparison of views tells how far apart they were taken."""

from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from scipy.stats import spearmanr

from omninav.pipeline import Context, Metrics, MetricSpec, MetricStage
from omninav.stages.geometry.appearance.visual_distance import MAX_GLOBAL_DISTANCE, colour_distances
from omninav.stages.geometry.arrays import Array, Bools
from omninav.stages.values.compared_views import ComparedViews
from omninav.stages.values.local_features import GlobalDescriptor
from omninav.stages.values.rooms import Rooms

SPECS = {
    "comparison.passed_rate": MetricSpec(title="Pairs of views that pass the colours", unit="%"),
    "comparison.other_rooms_left_out": MetricSpec(title="Pairs of two rooms left out by colours", unit="%"),
    "comparison.own_room_left_out": MetricSpec(title="Pairs of one room left out by colours", unit="%"),
    "comparison.two_lights.passed_rate": MetricSpec(title="Pairs of one place in two lights that pass the colours"),
    "comparison.two_lights.change": MetricSpec(
        title="Change of colours with the light, relative to that between two rooms"
    ),
    "comparison.rank_correlation": MetricSpec(title="Rank correlation of visual distance and metres"),
}
WITHIN_M = 8.0
"""Distance of views up to which visual distances are looked at, metres."""


class ComparedPairs(MetricStage):
    """Tests claims about comparing views (Goedemé et al. 2007, section 4.2) on every pair of a tour's views.

    Under `comparison`: `passed_rate`, the share of pairs whose global colours are close enough for their local features
    to be compared; `other_rooms_left_out` and `own_room_left_out`, the shares of pairs of two rooms, and of one, that
    are not; of pairs with something in common, at most `WITHIN_M` apart, `rank_correlation` of visual distance and
    metres (Spearman), and `by_metres`: medians of visual distance out to each of `to_m`. None where poses or rooms are
    not known. With global colours in other light, under `two_lights`: `passed_rate`, the share of pairs of a view and
    its own place in that light that pass; `change`, the median distance of their colours over that of two rooms' views.
    """

    def step(
        self,
        ctx: Context,
        views: ComparedViews,
        rooms: Rooms | None = None,
        other_light: Sequence[GlobalDescriptor | None] = (),
    ) -> MetricStage.Out:
        """The whole tour at once. `other_light`: of each of its images, the colours of its place in other light."""
        one, other = np.triu_indices(len(views), 1)
        colours = np.stack([each.values for each in views.descriptors]).astype(np.float64)
        apart = colour_distances(colours[one], colours[other])
        passed = apart <= MAX_GLOBAL_DISTANCE
        found: dict[str, Any] = {"passed_rate": _share(passed), "own_room_left_out": None, "other_rooms_left_out": None}
        known, of_two_rooms = views.pose_source == "truth", np.zeros(0)
        if known and rooms is not None:
            names = np.array([rooms.at(float(x), float(y)) for x, y, _ in views.poses])
            inside, same = (names[one] != "") & (names[other] != ""), names[one] == names[other]
            found["own_room_left_out"] = _share(~passed[inside & same])
            found["other_rooms_left_out"] = _share(~passed[inside & ~same])
            of_two_rooms = apart[inside & ~same]
        if known:
            metres = np.hypot(*(views.poses[one] - views.poses[other])[:, :2].T)
            near = (metres <= WITHIN_M) & np.isfinite(views.distances[one, other])
            found |= against_metres(views.distances[one, other][near], metres[near], WITHIN_M)
        if other_light:
            found["two_lights"] = self._two_lights(views, colours, other_light, of_two_rooms)
        return self.Out(metrics=Metrics({"comparison": found}, SPECS))

    def _two_lights(
        self, views: ComparedViews, colours: Array, other_light: Sequence[GlobalDescriptor | None], of_two_rooms: Array
    ) -> dict[str, float | None]:
        """Numbers of the views that are of this tour and not of a known map."""
        new = np.flatnonzero(views.owners < 0)
        first = 1 + int(views.frames[views.owners >= 0].max(initial=-1))
        seen = [(view, other_light[views.frames[view] - first]) for view in new]
        pairs = [(colours[view], other.values) for view, other in seen if other is not None]
        if not pairs:
            return {"passed_rate": None, "change": None}
        apart = colour_distances(*(np.stack(each) for each in zip(*pairs, strict=True)))
        change = float(np.median(apart) / np.median(of_two_rooms)) if len(of_two_rooms) else None
        return {"passed_rate": _share(apart <= MAX_GLOBAL_DISTANCE), "change": change}


def against_metres(distances: Array, metres: Array, within: float) -> dict[str, Any]:
    """Visual distances (K,) against metres (K,): rank correlation, and medians in rings that double in width."""
    edges = within / np.array([np.inf, 8.0, 4.0, 2.0, 1.0])
    rings = [(metres > low) & (metres <= high) for low, high in pairwise(edges)]
    medians = [float(np.median(distances[ring])) if ring.any() else None for ring in rings]
    varied = len(metres) > 2 and np.ptp(distances) > 0.0 and np.ptp(metres) > 0.0
    return {
        "rank_correlation": float(spearmanr(distances, metres).statistic) if varied else None,
        "by_metres": {"to_m": edges[1:].tolist(), "median": medians},
    }


def _share(hits: Bools) -> float | None:
    return float(hits.mean()) if len(hits) else None

"""Similarity of a view to the map's view of its own place, and how well it is distinguished from other places."""

from collections.abc import Sequence

import numpy as np

from omninav.pipeline import BadInput, Context, Metrics, MetricSpec, MetricStage, Outputs, Stage, Value
from omninav.stages.geometry.plane.se2 import wrap
from omninav.stages.values.maps import ReferenceGraph
from omninav.stages.values.pose import Pose
from omninav.stages.values.similarity import Similarities

SPECS = {
    "descriptor_contrast.similarity": MetricSpec(title="Similarity to the view of the same place", better="higher"),
    "descriptor_contrast.similarity_nearby": MetricSpec(title="Similarity to views taken nearby", better="higher"),
    "descriptor_contrast.similarity_elsewhere": MetricSpec(title="Similarity to views of other places"),
    "descriptor_contrast.lost": MetricSpec(title="Similarity lost at the same place", better="lower"),
    "descriptor_contrast.lost_nearby": MetricSpec(title="Similarity lost nearby", better="lower"),
    "descriptor_contrast.recognition_rate": MetricSpec(
        title="More similar to its own place than to all others", better="higher"
    ),
}

NEARBY_M = (0.5, 1.5)
"""Distances between which a view is nearby, metres."""
ELSEWHERE_M = 5.0
"""Distance from which a view is of another place, metres."""
OWN_M = 0.1
"""Distance up to which a reference is of the same place, metres."""
WITHIN_DEG = 5.0
"""Largest difference between the robot's heading and that of a reference, turned as compared, degrees."""


class PlaceContrast(Value):
    """Similarities of a view: to the map's view of its own place (`own`), to those `nearby` (mean; NaN where there
    are none), and to those of other places at their best headings, on `average` and at `most`."""

    own: float
    nearby: float
    average: float
    most: float


class DescriptorContrast(Stage):
    """Compares a view with the map's view of the same place, of places nearby, and of all others.

    For one tour as map and log, so that each view's own place is in the map; what was done to the view in between is
    what costs similarity. The headings of the robot and of the map's views are known. Absent where truth is, or where
    the map has no view of the place.
    """

    class Out(Outputs):
        likeness: PlaceContrast | None = None

    def step(self, ctx: Context, similarities: Similarities, truth: Pose | None, map: ReferenceGraph) -> Out:
        """One view. Raises BadInput where only some references were compared."""
        if similarities.candidates is not None:
            raise BadInput("descriptor_contrast: only some references were compared; type candidates=all")
        values, headings = similarities.values, similarities.values.shape[1]
        if truth is None or not len(map):
            return self.Out()
        away = np.hypot(*(map.poses[:, :2] - (truth.x, truth.y)).T)
        column = np.round((truth.heading - map.poses[:, 2]) * headings / (2 * np.pi)).astype(np.int64) % headings
        turned = wrap(map.poses[:, 2] + 2 * np.pi * column / headings - truth.heading)
        alike, same_way = values[np.arange(len(values)), column], np.abs(np.degrees(turned)) <= WITHIN_DEG
        own, elsewhere = (away <= OWN_M) & same_way, away >= ELSEWHERE_M
        nearby = (away >= NEARBY_M[0]) & (away <= NEARBY_M[1]) & same_way
        if not own.any() or not elsewhere.any():
            return self.Out()
        best = values[elsewhere].max(axis=1)
        beside = float(alike[nearby].mean()) if nearby.any() else float("nan")
        return self.Out(likeness=PlaceContrast(float(alike[own].max()), beside, float(best.mean()), float(best.max())))


class DescriptorRecognition(MetricStage):
    """Measures how much similarity views keep to those of their own places.

    Under `descriptor_contrast`, means over the images: `similarity` to the view of the same place,
    `similarity_nearby` and `similarity_elsewhere`; `lost` and `lost_nearby`, the shares (1 - own) / (1 - elsewhere) of
    the similarity that there is to lose; `recognition_rate`, the share of images that are more like their own place
    than any other place; `images`. Gives nothing without any comparison.
    """

    def step(self, ctx: Context, likenesses: Sequence[PlaceContrast | None]) -> MetricStage.Out:
        rows = np.array([(each.own, each.nearby, each.average, each.most) for each in likenesses if each is not None])
        if not len(rows):
            return self.Out()
        own, nearby, average, most = rows.T
        room, beside = 1.0 - average, np.isfinite(nearby)
        found = {
            "images": len(rows),
            "similarity": float(own.mean()),
            "similarity_nearby": float(nearby[beside].mean()) if beside.any() else None,
            "similarity_elsewhere": float(average.mean()),
            "lost": float(((1.0 - own) / room).mean()),
            "lost_nearby": float(((1.0 - nearby) / room)[beside].mean()) if beside.any() else None,
            "recognition_rate": float((own > most).mean()),
        }
        return self.Out(metrics=Metrics({"descriptor_contrast": found}, SPECS))

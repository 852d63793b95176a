"""Share of the most similar images that were taken near by."""

from collections.abc import Sequence

import numpy as np

from omninav.pipeline import Context, Metrics, MetricSpec, MetricStage
from omninav.stages.geometry.plane.se2 import wrap
from omninav.stages.values.drive import Drive, known
from omninav.stages.values.maps import ReferenceGraph
from omninav.stages.values.similarity import RetrievedReferences

SPECS = {
    "answers.nearby_rate": MetricSpec(title="Retrieved images taken nearby", better="higher"),
    "answers.first_nearby_rate": MetricSpec(title="First retrieved image taken nearby", better="higher"),
    "answers.background_rate": MetricSpec(title="All images of the map taken nearby"),
    "answers.first_similarity": MetricSpec(title="Similarity of the first retrieved image"),
    "answers.last_similarity": MetricSpec(title="Similarity of the last retrieved image"),
}
WITHIN_M = 5.0
"""Distance up to which an image was taken near by, metres."""
WITHIN_DEG = 30.0
"""Largest difference of the directions in which both look, by half of a window's field, degrees."""


class RetrievalPrecision(MetricStage):
    """Measures what share of a query's most similar images show the same scene.

    Wolf, Burgard & Burkhardt 2005, Figure 5: nine answers to a query. Of the last log, under `answers`, on average over
    the images: `nearby_rate`, the share of the answers that were taken within `WITHIN_M` of the robot and look the same
    way; `first_nearby_rate`, that of the first ones; `background_rate`, that share of the whole map; the similarities
    of the first and the last answer. Images that nothing near by was taken of count too. Gives nothing without truth.
    """

    def step(
        self, ctx: Context, drive: Drive, answers: Sequence[RetrievedReferences | None], map: ReferenceGraph
    ) -> MetricStage.Out:
        last = drive.last_log
        last = last.at(known(last.truth))
        rows = []
        for pose, row in zip(last.truth, last.row, strict=True):
            given = answers[row]
            if given is None or not len(given.references):
                continue
            near = np.hypot(*(map.poses[:, :2] - pose[:2]).T) <= WITHIN_M
            turned = np.abs(np.degrees(wrap(map.poses[given.references, 2] + given.turns - pose[2])))
            right = near[given.references] & (turned <= WITHIN_DEG)
            same_way = np.abs(np.degrees(wrap(map.poses[:, 2] - pose[2]))) <= WITHIN_DEG
            by_chance = (near & same_way).mean()
            rows.append((right.mean(), right[0], by_chance, given.similarities[0], given.similarities[-1]))
        if not rows:
            return self.Out()
        names = ("nearby_rate", "first_nearby_rate", "background_rate", "first_similarity", "last_similarity")
        means = np.array(rows, np.float64).mean(axis=0).tolist()
        return self.Out(metrics=Metrics({"answers": dict(zip(names, means, strict=True))}, SPECS))

"""Recall of place recognition: whether the most similar references were taken where the robot is."""

import itertools
from collections.abc import Sequence
from typing import Annotated, Any

import numpy as np
import numpy.typing as npt

from omninav.pipeline import Bounds, Context, Metrics, Outputs, Quantity, Stage, Value
from omninav.stages.geometry.plane.point_cells import have_a_point_within, sort_into_cells
from omninav.stages.values.drive import Array, Drive, known
from omninav.stages.values.maps import ReferenceGraph
from omninav.stages.values.similarity import Similarities

QUANTITIES = {
    "place_recognition.recall_at_1": Quantity(title="Recall@1", unit="%", better="higher"),
    "place_recognition.recall_at_5": Quantity(title="Recall@5", unit="%", better="higher"),
    "place_recognition.queries": Quantity(title="Queries", context=True),
    "place_recognition.distance_m": Quantity(title="Distance of a right reference"),
}


class RankedReferences(Value):
    """The references most similar to an image, the best first: (K,) their numbers in the map."""

    references: npt.NDArray[np.int64]


class RankReferences(Stage):
    """Ranks references by their similarity to the present image at the heading at which that is largest."""

    best: Annotated[int, Bounds(ge=1)] = 5
    """How many are kept."""

    class Out(Outputs):
        """`ranked`: the most similar references."""

        ranked: RankedReferences

    def step(self, ctx: Context, similarities: Similarities) -> Out:
        """One image."""
        values = similarities.values
        order = np.argsort(-values.max(axis=1), kind="stable")[: self.best] if len(values) else np.empty(0, np.int64)
        candidates = similarities.candidates
        return self.Out(ranked=RankedReferences(order if candidates is None else candidates[order]))


class PlaceRecognition(Stage):
    """Measures recall@1 and recall@5: how often one of the most similar references was taken close by.

    Of the last log, under `place_recognition`: the share of images (`queries`) for which one of the best N references
    lies within `distance_m` of the true position. An image counts where the map has such a reference at all. A filter
    that compares only references near its belief is measured on those.
    """

    distance_m: Annotated[float, Bounds(gt=0)] = 2.0
    """Largest distance (m) between the true position and where a right reference was taken."""

    class Out(Outputs):
        """`metrics`: absent where truth, or the truth of the map's poses, is not known."""

        metrics: Metrics | None = None

    def step(self, ctx: Context, drive: Drive, ranked: Sequence[RankedReferences | None], map: ReferenceGraph) -> Out:
        """The whole run at once."""
        last = drive.last_log
        last = last.at(known(last.truth))
        if map.pose_source != "truth" or not len(last) or not len(map):
            return self.Out()
        lists = [entry.references if (entry := ranked[row]) is not None else np.empty(0, np.int64) for row in last.row]
        found = recalls(last.truth[:, :2], lists, map.poses[:, :2], self.distance_m)
        headlines = ("place_recognition.recall_at_1", "place_recognition.recall_at_5")
        return self.Out(metrics=Metrics({"place_recognition": found}, QUANTITIES, headlines))


def recalls(
    positions: Array, ranked: Sequence[npt.NDArray[np.int64]], references: Array, distance_m: float
) -> dict[str, Any]:
    """Recall of ranked references for queries at positions (N, 2), by where references (R, 2) were taken (m)."""
    cells = sort_into_cells(references, distance_m)
    counts = have_a_point_within(cells, positions, float(np.nextafter(distance_m, np.inf)))
    hits = []
    for position, best in zip(positions[counts], itertools.compress(ranked, counts), strict=True):
        near = np.hypot(*(references[best[:5]] - position).T) <= distance_m
        hits.append((near[:1].any(), near.any()))
    first, five = np.array(hits, np.float64).reshape(-1, 2).mean(axis=0) if hits else (None, None)
    return {
        "queries": len(hits),
        "distance_m": distance_m,
        "recall_at_1": None if first is None else float(first),
        "recall_at_5": None if five is None else float(five),
    }

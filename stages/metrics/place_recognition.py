"""Recall of place recognition: whether the most similar references were taken where the robot is."""

import itertools
from collections.abc import Sequence
from typing import Annotated, Any

import numpy as np

from omninav.pipeline import Bounds, Context, Metrics, MetricSpec, Outputs, Stage, Table, Value
from omninav.stages.geometry.arrays import Array, Ints
from omninav.stages.geometry.plane.point_cells import have_a_point_within, sort_into_cells
from omninav.stages.values.drive import Drive, known
from omninav.stages.values.maps import ReferenceGraph
from omninav.stages.values.similarity import RetrievedReferences, Similarities
from omninav.stages.values.visual_words import PlaceWords

RANKS = (1, 5, 10)
"""Numbers of references of which one must be right."""
BEST = 10
"""References that are kept of an image."""
DISTANCES_M = (0.5, 1.0, 2.0, 5.0)
"""Distances of the table, metres."""


class RankedReferences(Value):
    """The references most similar to an image, the best first: (K,) their numbers in the map."""

    references: Ints


class RankReferences(Stage):
    """Ranks references by their similarity to the present image at the heading at which that is largest."""

    class Out(Outputs):
        ranked: RankedReferences

    def step(self, ctx: Context, similarities: Similarities) -> Out:
        order = (-similarities.best).argsort(kind="stable")[:BEST]
        candidates = similarities.candidates
        return self.Out(ranked=RankedReferences(order if candidates is None else candidates[order]))


class PlaceRecognition(Stage):
    """Measures recall@1, @5 and @10: how often one of the most similar references was taken close by.

    Of the last log, under `place_recognition`: the share of images (`queries`) for which one of the best N references
    is within `distance_m` of the true position. An image counts where the map has such a reference at all.
    `at_distances`: the same at several distances, a list for each figure. A filter that compares only references near
    its belief is measured on those.
    """

    distance_m: Annotated[float, Bounds(gt=0)] = 2.0
    """Largest distance (m) between the true position and where a right reference was taken."""

    class Out(Outputs):
        """Absent where truth, or the truth of the map's poses, is not known."""

        metrics: Metrics | None = None
        table: Table | None = None

    def step(
        self,
        ctx: Context,
        drive: Drive,
        ranked: Sequence[RankedReferences | RetrievedReferences | None],
        map: ReferenceGraph | PlaceWords | None = None,
    ) -> Out:
        """The whole run at once. `map`: what was ranked; of a topological map all views of its tour."""
        last = drive.last_log
        last = last.at(known(last.truth))
        if map is None or map.pose_source != "truth" or not len(last) or not len(map):
            return self.Out()
        lists = [entry.references if (entry := ranked[row]) is not None else np.array([], int) for row in last.row]
        given = last.truth[:, :2], lists, map.poses[:, :2]
        found = recalls(*given, self.distance_m)
        rows = [recalls(*given, distance) for distance in DISTANCES_M]
        found["at_distances"] = {name: [row[name] for row in rows] for name in rows[0]} if rows else {}
        headlines = ("place_recognition.recall_at_1",)
        metrics = Metrics({"place_recognition": found}, specs(self.distance_m), headlines)
        return self.Out(metrics=metrics, table=_tabled(rows))


def specs(distance_m: float) -> dict[str, MetricSpec]:
    """Titles of the figures, of references within a distance (m)."""
    recalled = {
        f"place_recognition.recall_at_{rank}": MetricSpec(
            title=f"Recall@{rank} within {distance_m:g} m", unit="%", better="higher"
        )
        for rank in RANKS
    }
    return recalled | {
        "place_recognition.queries": MetricSpec(title="Images that have a reference close by", context=True),
        "place_recognition.distance_m": MetricSpec(setting=True),
    }


def recalls(positions: Array, ranked: Sequence[Ints], references: Array, distance_m: float) -> dict[str, Any]:
    """Recall of ranked references for queries at positions (N, 2), by where references (R, 2) were taken (m)."""
    cells = sort_into_cells(references, distance_m)
    counts = have_a_point_within(cells, positions, float(np.nextafter(distance_m, np.inf)))
    hits = []
    for position, best in zip(positions[counts], itertools.compress(ranked, counts), strict=True):
        near = np.hypot(*(references[best[: max(RANKS)]] - position).T) <= distance_m
        hits.append([near[:rank].any() for rank in RANKS])
    shares = np.array(hits, np.float64).mean(axis=0).tolist() if hits else [None] * len(RANKS)
    return {
        "queries": len(hits),
        "distance_m": distance_m,
        **{f"recall_at_{rank}": share for rank, share in zip(RANKS, shares, strict=True)},
    }


def _tabled(rows: Sequence[dict[str, Any]]) -> Table:
    def percent(share: float | None) -> str:
        return "–" if share is None else f"{100 * share:.1f}"

    return Table(
        name="place_recognition",
        title="Recall of place recognition",
        caption="Share of images for which one of the N most similar references was taken within a distance; images "
        "without any such reference in the map do not count.",
        columns=("within (m)", *(f"recall@{rank} (%)" for rank in RANKS), "images"),
        rows=tuple(
            (f"{row['distance_m']:g}", *(percent(row[f"recall_at_{rank}"]) for rank in RANKS), row["queries"])
            for row in rows
        ),
    )

"""Precision and recall of a topological map's loop closures, and the map's size."""

from typing import Any

import networkx
import numpy as np

from omninav.pipeline import Context, Metrics, MetricSpec, Outputs, Plot, Stage
from omninav.pipeline.engine.artifact import artifact_bytes
from omninav.pipeline.report.chart import Chart
from omninav.stages.geometry.arrays import Array, Bools
from omninav.stages.geometry.probability.dempster_shafer import SUPPORT, UNKNOWN
from omninav.stages.values.topological_map import LoopHypotheses, TopologicalMap

SPECS = {
    "loops.loop_closures.precision": MetricSpec(title="Loop closures, precision", unit="%", better="higher"),
    "loops.loop_closures.recall": MetricSpec(title="Loop closures, recall", unit="%", better="higher"),
    "loops.loop_closures.average_precision": MetricSpec(
        title="Loop closures, average precision", unit="%", better="higher"
    ),
    "precision": MetricSpec(unit="%", better="higher"),
    "recall": MetricSpec(unit="%", better="higher"),
    "wrong": MetricSpec(title="Loop closures accepted wrongly", better="lower"),
    "map.places": MetricSpec(title="Places in the map", context=True),
    "map.size_bytes": MetricSpec(title="Map size", better="lower"),
    "map.place_size_bytes": MetricSpec(title="Size of a place", better="lower"),
    "map.step_m": MetricSpec(title="Distance between path images"),
}
HEADLINES = ("loops.loop_closures.precision", "loops.loop_closures.recall")
NEAR_M = 2.5
"""Largest distance between two images of one place, metres."""
MIN_IMAGES_BETWEEN = 10
"""Images of the tour that must be between two views for their hypothesis to be a loop closure."""


class LoopClosures(Stage):
    """Measures precision and recall of accepted loop hypotheses against truth, and the size of the map.

    A hypothesis is right where some image of one of its subclusters was taken near some image of the other. Precision
    is the share of accepted ones that are right, recall the share of right ones that are accepted; None where there are
    none, or where the map's poses are not truth. `loop_closures` leaves out those between views of one stretch of the
    drive, and adds `average_precision`, the area under the precision-recall curve over the support, sum over n of
    P_n (R_n - R_(n-1)) with the precision P_n and recall R_n of the n best supported ones; `merged`, of
    these: counts as accepted what became one place, be it through third ones. `neighbours`: what their evidence brings
    (see there). `at_supports` is what they would be with
    other thresholds of support. `parts`: between which no path leads; more than one where a map was added to from a
    tour that it does not know. `step_m`: how far apart neighbouring path images were taken. `size_bytes`: of the map's
    file, without its description of its making.
    """

    class Out(Outputs):
        """`metrics`: the entries `map` and `loops` of metrics.json; `plot`: absent where no loop closure is right."""

        metrics: Metrics
        plot: Plot | None = None

    def step(self, ctx: Context, hypotheses: LoopHypotheses, map: TopologicalMap) -> Out:
        size = len(artifact_bytes(map))
        held: dict[str, Any] = {
            "size_bytes": size,
            "places": len(map),
            "links": len(map.links),
            "parts": parts_of(map),
            "views": len(map.views),
            "place_size_bytes": size / len(map) if len(map) else None,
            "pose_source": map.pose_source,
        }
        steps = path_steps(map)
        if len(steps):
            held["step_m"] = {"median": float(np.median(steps)), "p90": float(np.quantile(steps, 0.9)),
                              "max": float(steps.max())}  # fmt: skip
        right = hypothesis_gaps(hypotheses) <= NEAR_M if hypotheses.pose_source == "truth" else None
        far = np.abs(hypotheses.pairs[:, 1] - hypotheses.pairs[:, 0]) >= MIN_IMAGES_BETWEEN
        one, other = hypotheses.place[hypotheses.pairs].T
        supports, closed = hypotheses.masses[far, SUPPORT], None if right is None else right[far]
        some = closed if closed is not None and closed.any() else None
        loops = {
            **counted(hypotheses.accepted, right),
            "loop_closures": {
                **counted(hypotheses.accepted[far], closed),
                "average_precision": None if some is None else average_precision(supports, some),
            },
            "merged": counted((one == other)[far], closed),
            "neighbours": neighbours(hypotheses.initial[far], hypotheses.masses[far], closed),
            "at_supports": at_supports(supports, closed),
        }
        plot = None if some is None else _drawn(supports, some)
        return self.Out(metrics=Metrics({"map": held, "loops": loops}, SPECS, HEADLINES), plot=plot)


def parts_of(map: TopologicalMap) -> int:
    """Into how many parts a map falls between which no link leads."""
    graph = networkx.Graph(map.links.tolist())
    graph.add_nodes_from(range(len(map)))
    return int(networkx.number_connected_components(graph))


def counted(accepted: Bools, right: Bools | None) -> dict[str, float | int | None]:
    """Numbers of hypotheses (H,), accepted, rejected and wrongly accepted ones, precision and recall.

    `right` (H,): None where it is not known.
    """
    known: dict[str, float | int | None] = {
        "hypotheses": len(accepted),
        "accepted": int(accepted.sum()),
        "rejected": int((~accepted).sum()),
    }
    if right is None:
        return {**known, "wrong": None, "precision": None, "recall": None}
    found = int((accepted & right).sum())
    return {
        **known,
        "wrong": int((accepted & ~right).sum()),
        "precision": found / int(accepted.sum()) if accepted.any() else None,
        "recall": found / int(right.sum()) if right.any() else None,
    }


def neighbours(initial: Array, masses: Array, right: Bools | None) -> dict[str, float | None]:
    """Gain by the evidence of neighbouring hypotheses, of masses (H, 3) before it and after.

    `area_gain`: by how much the area under the precision-recall curve grows; `wrong_without`: how many wrong ones have
    a support above one half before; `right_alone`: the share of right ones of which no neighbour has spoken. None where
    no hypothesis is `right` (H,), or it is not known which are.
    """
    if right is None or not right.any():
        return {"area_gain": None, "wrong_without": None, "right_alone": None}
    before = initial[:, SUPPORT]
    return {
        "area_gain": average_precision(masses[:, SUPPORT], right) - average_precision(before, right),
        "wrong_without": float(np.count_nonzero((before > 0.5) & ~right)),
        "right_alone": float((masses[right, UNKNOWN] >= initial[right, UNKNOWN]).mean()),
    }


def average_precision(support: Array, right: Bools) -> float:
    """Area under the curve of `precision_recall`: the sum of precision times the increase of recall."""
    precision, recall = precision_recall(support, right)
    return float((precision * np.diff(recall, prepend=0.0)).sum())


def precision_recall(support: Array, right: Bools) -> tuple[Array, Array]:
    """Precision and recall of hypotheses (H,) accepted by falling support, after each of its values; one must be right.

    Hypotheses of equal support are accepted together.
    """
    order = np.argsort(-support, kind="stable")
    last_of_equals = np.append(np.diff(support[order]) != 0, True)
    accepted = (np.arange(len(order)) + 1)[last_of_equals]
    found = np.cumsum(right[order])[last_of_equals]
    return found / accepted, found / right.sum()


def _drawn(support: Array, right: Bools) -> Plot:
    precision, recall = precision_recall(support, right)
    chart = Chart((0.0, 1.0), (0.0, 1.0), "recall", "precision", height=(260.0, 260.0))
    edges = np.repeat(np.append(0.0, recall), 2)[1:-1]
    chart.base.line(np.column_stack([edges, np.repeat(precision, 2)]), "blue", 1.8)  # as high as where a step ends
    return Plot(
        name="precision_recall",
        title="Precision and recall of loop closures",
        caption=f"Loop closures accepted by falling support, {int(right.sum())} of {len(right)} right. The area below "
        f"the line, the sum of Pₙ (Rₙ - Rₙ₋₁), is {100 * average_precision(support, right):.1f} %.",
        content=chart.svg(),
        media_type="image/svg+xml",
        order=31,
    )


def at_supports(support: Array, right: Bools | None) -> dict[str, list[float | int | None]]:
    """Figures of `counted` for hypotheses with `support` (H,) above each of 0.05, 0.1 … 0.95: a list for each."""
    thresholds = [round(0.05 * k, 2) for k in range(1, 20)]
    counts = [counted(support > threshold, right) for threshold in thresholds]
    return {"support": list(thresholds), **{name: [count[name] for count in counts] for name in counts[0]}}


def hypothesis_gaps(found: LoopHypotheses) -> Array:
    """Distance between the two subclusters of each hypothesis: (H,) metres, between their nearest images."""
    members = {number: found.poses[found.subcluster == number] for number in np.unique(found.subcluster).tolist()}
    gaps = np.empty(len(found.pairs))
    for row, (one, other) in enumerate(found.subcluster[found.pairs].tolist()):
        between = members[one][:, None] - members[other][None]
        gaps[row] = np.hypot(between[..., 0], between[..., 1]).min()
    return gaps


def path_steps(map: TopologicalMap) -> Array:
    """Distances between neighbouring views on all paths between places: metres, by the map's poses."""
    paths = [map.poses[map.whole_way(link), :2] for link in range(len(map.links))]
    return np.concatenate([np.empty(0), *(np.hypot(*np.diff(path, axis=0).T) for path in paths)])

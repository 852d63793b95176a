"""What a topological map is worth: its size, and which of its loops were closed rightly."""

from typing import Annotated, Any

import networkx
import numpy as np
import numpy.typing as npt

from omninav.pipeline import Bounds, Context, Outputs, Stage
from omninav.pipeline.engine.artifact import artifact_bytes
from omninav.pipeline.graph.results import Metrics
from omninav.stages.geometry.probability.dempster_shafer import support
from omninav.stages.values.topological_map import LoopHypotheses, TopologicalMap

Array = npt.NDArray[np.float64]


class LoopClosures(Stage):
    """Precision and recall of accepted loop hypotheses against truth, and how large the map is.

    A hypothesis is right where some picture of one of its subclusters was taken within `near_m` of some picture of the
    other. Precision is the share of accepted ones that are right, recall the share of right ones that are accepted;
    None where there are none, or where the map's poses are not truth. `far_in_drive` leaves out those whose views are
    less than `apart` pictures apart; `merged`, of these: counts as accepted what became one place, be it through third
    ones. `parts`: between which no way leads; more than one where a map was added to from a tour that it does not
    know. `at_supports` is what they would be with other thresholds of support. `step_m`:
    how far apart neighbouring path images were taken. `size_bytes`: of the map's file, but for what it says of
    its making.
    """

    near_m: Annotated[float, Bounds(gt=0)] = 2.5
    apart: Annotated[int, Bounds(ge=1)] = 10

    class Out(Outputs):
        """`metrics`: the entries `map` and `loops` of metrics.json."""

        metrics: Metrics

    def step(self, ctx: Context, hypotheses: LoopHypotheses, map: TopologicalMap) -> Out:
        """The map and what it was made of."""
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
        gaps = hypothesis_gaps(hypotheses) if hypotheses.pose_source == "truth" else None
        far = np.abs(np.diff(hypotheses.pairs, axis=1))[:, 0] >= self.apart
        one, other = hypotheses.place[hypotheses.pairs].T
        told, near = support(hypotheses.masses), None if gaps is None else gaps[far]
        loops = {
            **counted(hypotheses.accepted, gaps, self.near_m),
            "far_in_drive": counted(hypotheses.accepted[far], near, self.near_m),
            "merged": counted((one == other)[far], near, self.near_m),
            "at_supports": at_supports(told[far], near, self.near_m),
        }
        return self.Out(metrics=Metrics({"map": held, "loops": loops}))


def parts_of(map: TopologicalMap) -> int:
    """Into how many parts a map falls between which no link leads."""
    graph = networkx.Graph(map.links.tolist())
    graph.add_nodes_from(range(len(map)))
    return int(networkx.number_connected_components(graph))


def counted(accepted: npt.NDArray[np.bool_], gaps: Array | None, near: float) -> dict[str, float | int | None]:
    """Numbers of hypotheses, accepted, rejected and wrongly accepted ones, precision and recall.

    `gaps` (H,): metres between the two, None where it is not known.
    """
    known: dict[str, float | int | None] = {
        "hypotheses": len(accepted),
        "accepted": int(accepted.sum()),
        "rejected": int((~accepted).sum()),
    }
    if gaps is None:
        return {**known, "wrong": None, "precision": None, "recall": None}
    right = gaps <= near
    found = int((accepted & right).sum())
    return {
        **known,
        "wrong": int((accepted & ~right).sum()),
        "precision": found / int(accepted.sum()) if accepted.any() else None,
        "recall": found / int(right.sum()) if right.any() else None,
    }


def at_supports(support: Array, gaps: Array | None, near: float) -> dict[str, list[float | int | None]]:
    """What `counted` says of hypotheses with `support` (H,) above each of 0.05, 0.1 … 0.95: a list for each figure."""
    thresholds = [round(0.05 * k, 2) for k in range(1, 20)]
    counts = [counted(support > threshold, gaps, near) for threshold in thresholds]
    return {"support": list(thresholds), **{name: [count[name] for count in counts] for name in counts[0]}}


def hypothesis_gaps(found: LoopHypotheses) -> Array:
    """How far apart the two subclusters of each hypothesis came: (H,) metres, between their nearest pictures."""
    at = found.poses[:, :2]
    members = [at[found.subcluster == number] for number in range(int(found.subcluster.max(initial=-1)) + 1)]
    gaps = np.empty(len(found.pairs))
    for row, (one, other) in enumerate(found.subcluster[found.pairs]):
        between = members[one][:, None] - members[other][None]
        gaps[row] = np.hypot(between[..., 0], between[..., 1]).min()
    return gaps


def path_steps(map: TopologicalMap) -> Array:
    """How far apart neighbouring views on all ways between places were taken: metres, by the map's poses."""
    steps = [np.empty(0)]
    for link, (one, other) in enumerate(map.links):
        way = map.poses[[map.places[one], *map.way(link), map.places[other]], :2]
        steps.append(np.hypot(*np.diff(way, axis=0).T))
    return np.concatenate(steps)

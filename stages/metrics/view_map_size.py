"""Size of a map of views, and how densely it covers what was visited."""

import dataclasses

import numpy as np

from omninav.pipeline import Context, Metrics, MetricSpec, MetricStage
from omninav.stages.geometry.arrays import Array
from omninav.stages.values.drive import Drive, known
from omninav.stages.values.view_mixtures import ViewMixtures

from . import map_size

SPECS = map_size.SPECS | {
    "map.visited_area_m2": MetricSpec(title="Visited area", unit="m²"),
    "map.references_per_m2": MetricSpec(title="References per m²"),
}
NEAR_M = 1.0
"""Distance from the true path (from the estimates where there is no truth) up to which the area is visited, metres."""


class ViewMapSize(MetricStage):
    """Measures the size of a map of views at the end of a run, and how densely it covers what was visited.

    Under `map`: `references` (views), `components`, `size_bytes` of all its arrays as stored in its file (whose head,
    some kilobytes of text, is not counted), `reference_size_bytes` (a view's share of them), `pose_source`,
    `visited_area_m2` and `references_per_m2`. A known map may hold more than what this run visited: its density then
    is too high.
    """

    def step(self, ctx: Context, drive: Drive, map: ViewMixtures) -> MetricStage.Out:
        ctx.fact("map_poses", map.pose_source)
        poses = drive.truth if drive.has_truth else drive.estimate
        path = poses[known(poses)][:, :2]
        size, area = stored_bytes(map), visited_area(path, NEAR_M)
        figures = {
            "size_bytes": size,
            "references": len(map),
            "components": len(map.weights),
            "reference_size_bytes": size / len(map) if len(map) else None,
            "pose_source": map.pose_source,
            "visited_area_m2": area,
            "references_per_m2": len(map) / area if area else None,
        }
        return self.Out(metrics=Metrics({"map": figures}, SPECS, ("map.references", "map.size_bytes")))


def stored_bytes(map: ViewMixtures) -> int:
    """Bytes of a map's arrays."""
    fields = (getattr(map, field.name) for field in dataclasses.fields(map))
    return sum(field.nbytes for field in fields if isinstance(field, np.ndarray))


def visited_area(path: Array, near_m: float) -> float:
    """Area (m²) within `near_m` of a path (N, 2), counted in square cells of half that side by their middles."""
    if not len(path):
        return 0.0
    side = near_m / 2
    steps = np.arange(-2, 3)
    around = np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2)
    home = np.unique(np.floor(path / (side / 4)).astype(np.int64), axis=0)  # a standing robot counts once
    points = (home + 0.5) * (side / 4)
    cells = np.floor(points / side).astype(np.int64)[:, None, :] + around
    within = np.linalg.norm((cells + 0.5) * side - points[:, None, :], axis=2) <= near_m
    return float(len(np.unique(cells[within], axis=0)) * side**2)

"""Straightens a map whose poses are odometry by the places that the drive came back to."""

from collections.abc import Sequence

import numpy as np

from omninav.pipeline import Context, Metrics, MetricSpec, Outputs, Stage, Tick
from omninav.stages.geometry.appearance.closures import closures_by_appearance
from omninav.stages.geometry.appearance.length_scale import length_scale
from omninav.stages.geometry.plane.drive_graph import closure_sigmas, straightened_drives
from omninav.stages.geometry.plane.se2 import distances_along
from omninav.stages.values.maps import ReferenceGraph

from .pose_of_view import warn_of_few

SPECS = {
    "straightened.closures": MetricSpec(title="Loop closures found", context=True),
    "straightened.rejected": MetricSpec(title="Loop closures rejected, as the others contradict them", context=True),
    "straightened.moved_median_m": MetricSpec(title="References moved by, median", context=True),
    "straightened.moved_max_m": MetricSpec(title="References moved by, largest", context=True),
}


class StraightenMap(Stage):
    """Corrects the references' poses in a map made by odometry so that loop closures become consistent.

    References that look alike although the drive is between them close a loop; a pose graph of odometry and closures
    gives the poses, with Cauchy's loss on closures, since some are wrong. The first reference stays. Poses that are
    ground truth, views of one direction and drives that come back to no place are left as they are: without a crossing
    nothing tells how odometry bent them. Manifest fact `map_straightened`.

    Not in the paper, whose maps are corrected by a laser scanner. Pose graphs: Grisetti et al. 2010, "A tutorial on
    graph-based SLAM". Defaults: docs/experiments/straightened_maps.md.
    """

    class Out(Outputs):
        """The map with straightened poses, or as it was."""

        map: ReferenceGraph
        metrics: Metrics | None = None

    def step(self, ctx: Context, map: ReferenceGraph, ticks: Sequence[Tick]) -> Out:
        """The finished map; `ticks` are collected so that it is finished."""
        warn_of_few(ctx, len(map))
        if map.pose_source == "truth":
            return self.Out(map=map)
        unit = length_scale(map.poses, map.features, map.kind) if map.features.shape[1] > 1 else None
        if unit is None:
            ctx.fact("map_straightened", "no: a map needs ten views, all around the robot")
            return self.Out(map=map)
        driven = distances_along(map.poses)
        closures = closures_by_appearance(map.features[:], map.kind, driven, unit)
        if not len(closures.pairs):
            ctx.fact(
                "map_straightened", "no: no loop closure was found in the tour, so odometry's drift cannot be corrected"
            )
            return self.Out(map=map)
        poses, weights = straightened_drives(map.poses, np.zeros(len(map), np.int64), closures, *closure_sigmas(unit))
        moved = np.hypot(*(poses - map.poses)[:, :2].T)
        values = {
            "closures": len(closures.pairs),
            "rejected": int((weights < 0.1).sum()),
            "moved_median_m": float(np.median(moved)),
            "moved_max_m": float(moved.max()),
        }
        ctx.fact("map_straightened", "by {closures} closures, {moved_max_m:.2f} m at most".format(**values))
        metrics = Metrics({"straightened": values}, SPECS)
        return self.Out(map=map.moved(poses), metrics=metrics)

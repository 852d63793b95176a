"""Errors of the poses of a map's references."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from omninav.pipeline import Context, Metrics, MetricSpec, MetricStage
from omninav.stages.values.drive import pose_rows
from omninav.stages.values.maps import ReferenceEvent, ReferenceGraph
from omninav.stages.values.pose import Pose

from .relative_errors import absolute_trajectory_errors

SPECS = {
    "map_error.as_driven_m": MetricSpec(title="Map: error of the positions by odometry", better="lower"),
    "map_error.straightened_m": MetricSpec(title="Map: error of the positions straightened", better="lower"),
}


class MapPoseErrors(MetricStage):
    """Measures the positions of references by odometry against true ones, where the log has both.

    Under `map_error`: the root mean square distance (m) after the map as a whole was moved and turned to fit best,
    `as_driven_m` by odometry and `straightened_m` by the map that is saved; `references`, of how many. Nothing for a
    map whose poses are true ones.
    """

    def step(
        self,
        ctx: Context,
        events: Sequence[ReferenceEvent | None],
        truth: Sequence[Pose | None],
        map: ReferenceGraph,
        straightened: ReferenceGraph,
    ) -> MetricStage.Out:
        if map.pose_source == "truth" or not len(map):
            return self.Out()
        where = np.full((len(map), 3), np.nan)
        for event, pose in zip(events, pose_rows(truth), strict=True):
            if event is not None:
                where[event.inserted] = pose
        known = np.isfinite(where).all(axis=1)
        if known.sum() < 3:
            return self.Out()
        values: dict[str, Any] = {"references": int(known.sum())}
        for name, poses in (("as_driven_m", map.poses), ("straightened_m", straightened.poses)):
            values[name] = float(np.sqrt((absolute_trajectory_errors(poses[known], where[known]) ** 2).mean()))
        return self.Out(metrics=Metrics({"map_error": values}, SPECS))

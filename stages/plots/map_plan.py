"""Plots a map: where its reference views were taken."""

import numpy as np

from omninav.pipeline import Context, PlotStage
from omninav.stages.geometry.arrays import Array
from omninav.stages.values.drive import Drive
from omninav.stages.values.floor_plan import FloorPlan
from omninav.stages.values.maps import ReferenceGraph
from omninav.stages.values.pose import SOURCE_WORDS

from .drawing import extent_of, landmarks_of
from .plan_chart import draw_landmarks, draw_surroundings, plan_chart


class MapPlot(PlotStage):
    """Plots the map's references with their headings, and its edges. Map frame, metres.

    `as_driven`: the same map before it was straightened, drawn where that moved it. Gives nothing where the map is
    empty.
    """

    def step(
        self,
        ctx: Context,
        drive: Drive,
        map: ReferenceGraph,
        plan: FloorPlan | None = None,
        as_driven: ReferenceGraph | None = None,
    ) -> PlotStage.Out:
        """The map at the end of the run; `drive` makes it wait until then."""
        if not len(map):
            return self.Out()
        before = None if as_driven is None or np.array_equal(as_driven.poses, map.poses) else as_driven.poses
        straightened = "" if before is None else " They were straightened where the tour came back to a place."
        return self.drawn(
            name="map_plan",
            title="The map",
            caption=f"{len(map)} reference views and {len(map.edges)} edges, from {len(drive)} frames. Arrows "
            f"point along the robot's heading when the view was taken. "
            f"The poses are taken from {SOURCE_WORDS[map.pose_source]}.{straightened}",
            content=_draw(map, plan, before),
            order=8,
        )


def _draw(map: ReferenceGraph, plan: FloorPlan | None, before: Array | None) -> bytes:
    shown = map.poses if before is None else np.concatenate([map.poses, before])
    chart = plan_chart(extent_of(shown, landmarks_of(map), margin=0.05))
    draw_landmarks(chart, map)
    draw_surroundings(chart, map, None, plan)
    if before is not None:
        chart.base.line(before[:, :2], "orange", 1.4, dashed=True)
        chart.name("as driven, by odometry", "orange", "dashes")
    for pose in map.poses:
        chart.base.dart(pose, "blue", 5.0)
    chart.name("headings", "blue", "square")
    return chart.svg()

"""Plots a map: where its reference views were taken."""

import numpy as np

from omninav.pipeline import Context, Figure, Outputs, Stage
from omninav.pipeline.report.plot_style import plot
from omninav.stages.values.drive import Drive
from omninav.stages.values.maps import ReferenceGraph

from .drawing import ESTIMATE, draw_map, extent_of, fitting_height, plan_axes


class MapPlot(Stage):
    """Plots the map's references with their headings, and its edges. Map frame, metres."""

    class Out(Outputs):
        """`figure`: absent where the map is empty."""

        figure: Figure | None = None

    def step(self, ctx: Context, drive: Drive, map: ReferenceGraph) -> Out:
        """The map at the end of the run; `drive` makes it wait until then."""
        if not len(map):
            return self.Out()
        return self.Out(
            figure=Figure(
                name="map_plan",
                title="The map",
                caption=f"{len(map)} reference views and {len(map.edges)} edges, from {len(drive)} frames. Arrows "
                f"point along the robot's heading when the view was taken. The poses are taken from {map.pose_source}.",
                content=_draw(map),
                order=8,
            )
        )


def _draw(map: ReferenceGraph) -> bytes:
    extent = extent_of(map.poses, margin=0.08)
    with plot(8.0, fitting_height(extent, 8.0, 2.6, 8.5)) as drawn:
        axes = drawn.canvas.add_subplot()
        draw_map(axes, map)
        heading = map.poses[:, 2]
        ahead = (np.cos(heading), np.sin(heading))
        axes.quiver(*map.poses[:, :2].T, *ahead, color=ESTIMATE, scale=45, width=0.0018, headwidth=4, zorder=2)
        plan_axes(axes, extent)
        drawn.canvas.legend(loc="outside lower center")
    return drawn.content

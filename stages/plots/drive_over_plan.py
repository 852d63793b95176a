"""Plots where a robot drove, over the plan of its world."""

from collections.abc import Sequence

import numpy as np

from omninav.pipeline import Context, Figure, Outputs, Stage
from omninav.pipeline.report.plot_style import plot
from omninav.stages.values.drive import Array, Drive
from omninav.stages.values.floor_plan import FloorPlan
from omninav.stages.values.planned_route import PlannedRoute
from omninav.stages.values.topological_map import TopologicalMap

from .drawing import (
    EDGE,
    ESTIMATE,
    MARK,
    ODOMETRY,
    REFERENCE,
    broken_at_jumps,
    draw_links,
    fitting_height,
    plan_axes,
)


class DriveOverPlan(Stage):
    """Plots the true path of a closed loop over the floor plan, every contact on it, and the path by odometry alone.

    With `map` wired its places, where their medoids were taken, joined along the images between them; with `routes` the
    planned routes, the last one bold, and its goal.
    """

    class Out(Outputs):
        """`figure`: one plot; absent where the robot never was."""

        figure: Figure | None = None

    def step(
        self,
        ctx: Context,
        drive: Drive,
        plan: FloorPlan,
        map: TopologicalMap | None = None,
        routes: Sequence[PlannedRoute | None] | None = None,
    ) -> Out:
        """The whole run at once."""
        if not drive.has_truth:
            return self.Out()
        contacts = np.flatnonzero(np.diff(drive.collisions, prepend=0) > 0)
        path, dead_reckoning = drive.truth, drive.odometry_alone()
        planned = planned_routes(routes or (), map)
        return self.Out(
            figure=Figure(
                name="drive_over_plan",
                title="Path driven",
                caption=f"The true path of {len(path)} ticks over the floor plan, which the robot does not know. "
                f"It touched something {int(drive.collisions.max())} times (orange crosses). "
                f"Dashed: odometry alone.{_caption_of_map(map, planned)}",
                content=_draw(path, dead_reckoning, path[contacts], plan, map, planned),
                order=4,
            )
        )


def planned_routes(routes: Sequence[PlannedRoute | None], map: TopologicalMap | None) -> list[Array]:
    """Each route that was planned, in order: x and y (V, 2) of the views along it."""
    if map is None:
        return []
    found = {route.number: route.places for route in routes if route is not None and len(route.places)}
    return [map.poses[map.views_along(found[number])[0]][:, :2] for number in sorted(found)]


def _caption_of_map(map: TopologicalMap | None, planned: Sequence[Array]) -> str:
    if map is None:
        return ""
    places = f" Grey: the {len(map)} places of its map, and the links between them along their images."
    if not planned:
        return f"{places} It planned no route."
    earlier = f", thin: the {len(planned) - 1} before it" if len(planned) > 1 else ""
    return f"{places} Green: the route that it planned last{earlier}, and its goal."


def _draw(
    path: Array,
    dead_reckoning: Array | None,
    contacts: Array,
    plan: FloorPlan,
    map: TopologicalMap | None,
    planned: Sequence[Array],
) -> bytes:
    from matplotlib.collections import PolyCollection

    extent = (-0.3, plan.width + 0.3, -0.3, plan.depth + 0.3)
    with plot(8.0, fitting_height(extent, 8.0, 2.6, 8.5)) as drawn:
        axes = drawn.canvas.add_subplot()
        axes.add_collection(PolyCollection(list(plan.outlines), facecolors=EDGE, edgecolors=REFERENCE, linewidths=0.6))
        if map is not None:
            draw_links(axes, map)
            spots = map.poses[map.places]
            axes.plot(*spots[:, :2].T, "o", color=REFERENCE, markersize=4, zorder=2, label=f"places ({len(map)})")
        for number, route in enumerate(planned):
            last = number == len(planned) - 1
            look = (
                {"linewidth": 6.0, "alpha": 0.45, "label": "planned route"}
                if last
                else {"linewidth": 1.5, "alpha": 0.6}
            )
            axes.plot(*route.T, color=MARK, solid_capstyle="round", zorder=2.2, **look)
        if planned:
            axes.plot(*planned[-1][-1:].T, "*", color=MARK, markersize=15, zorder=6, label="goal")
        if dead_reckoning is not None:
            axes.plot(*dead_reckoning[:, :2].T, "--", color=ODOMETRY, linewidth=1.0, label="odometry alone")
        axes.plot(*broken_at_jumps(path).T, color=ESTIMATE, linewidth=1.6, zorder=4, label="true path")
        axes.plot(*path[:1, :2].T, "s", color=MARK, markersize=7, zorder=5, label="start")
        if len(contacts):
            axes.plot(*contacts[:, :2].T, "x", color=ODOMETRY, markersize=7, markeredgewidth=2, label="contact")
        plan_axes(axes, extent)
        drawn.canvas.legend(loc="outside lower center", ncols=7 if map is not None else 4)
    return drawn.content

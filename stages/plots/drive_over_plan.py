"""Plots where a robot drove, over the plan of its world."""

from collections.abc import Sequence

import numpy as np

from omninav.pipeline import Context, Figure, FigureStage
from omninav.pipeline.graph.problems import counted
from omninav.pipeline.report.chart import broken
from omninav.stages.values.drive import Array, Drive
from omninav.stages.values.floor_plan import FloorPlan
from omninav.stages.values.planned_route import PlannedRoute
from omninav.stages.values.topological_map import TopologicalMap

from .plan_chart import draw_surroundings, jumps, plan_chart


class DriveOverPlan(FigureStage):
    """Plots the true path of a closed loop over the floor plan, every contact on it, and the path by odometry alone.

    With `map` wired its places, where their medoids were taken, joined along the images between them; with `routes` the
    planned routes, the last one bold, and its goal. Gives nothing where the robot never was.
    """

    def step(
        self,
        ctx: Context,
        drive: Drive,
        plan: FloorPlan,
        map: TopologicalMap | None = None,
        routes: Sequence[PlannedRoute | None] | None = None,
    ) -> FigureStage.Out:
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
                f"It collided {counted(int(drive.collisions.max()), 'time')} (orange crosses). "
                f"Dashed: odometry alone.{_caption_of_map(map, planned)}",
                content=_draw(path, dead_reckoning, path[contacts], plan, map, planned),
                media_type="image/svg+xml",
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
    chart = plan_chart((-0.3, plan.width + 0.3, -0.3, plan.depth + 0.3))
    for number, route in enumerate(planned):
        last = number == len(planned) - 1
        chart.base.line(route, "green", 7.0 if last else 1.8, opacity=0.45)
    draw_surroundings(chart, map, None, plan)
    if dead_reckoning is not None:
        chart.base.line(dead_reckoning, "orange", 1.2, dashed=True)
        chart.name("odometry alone", "orange", "dashes")
    chart.base.line(broken(path, jumps(path, 1.0)), "blue", 1.8)
    chart.name("true path", "blue")
    chart.base.square(path[0], "green")
    chart.name("start", "green", "square")
    if planned:
        chart.base.ring(planned[-1][-1], "green", 8.0)
        chart.name("planned route, goal", "green", "ring")
    if len(contacts):
        chart.base.crosses(contacts, "orange")
        chart.name("contact", "orange", "square")
    return chart.svg()

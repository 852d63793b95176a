"""Plots estimated trajectories over the map."""

from collections.abc import Sequence

import numpy as np

from omninav.pipeline import Context, Outputs, Plot, Stage, counted
from omninav.pipeline.report.chart import broken
from omninav.stages.geometry.arrays import Array
from omninav.stages.values.drive import Drive, known
from omninav.stages.values.floor_plan import FloorPlan
from omninav.stages.values.grid import OccupancyGrid
from omninav.stages.values.map_places import AnyMap, map_poses
from omninav.stages.values.planned_route import PlannedRoute
from omninav.stages.values.pose import SOURCE_WORDS
from omninav.stages.values.topological_map import TopologicalMap

from .drawing import extent_of, landmarks_of
from .plan_chart import draw_landmarks, draw_surroundings, jumps, plan_chart


class TrajectoryOverMap(Stage):
    """Plots estimate, truth and odometry alone over the map's references and edges (map frame, m).

    With `grid` or `plan` wired, all of it over what is on the floor. The last log has a plot of its own. Of a robot
    that drives by itself every contact is marked; with `routes` the planned routes, the last one bold, and its goal.
    """

    class Out(Outputs):
        """`plot`: the last log; `earlier`: where there are several, the ones before it in one plot."""

        plot: Plot | None = None
        earlier: Plot | None = None

    def step(
        self,
        ctx: Context,
        drive: Drive,
        map: AnyMap | None = None,
        grid: OccupancyGrid | None = None,
        plan: FloorPlan | None = None,
        routes: Sequence[PlannedRoute | None] | None = None,
    ) -> Out:
        logs = drive.by_log
        if not logs:
            return self.Out()
        planned = [] if routes is None else planned_routes(routes, map)
        last = Plot(
            name="trajectory_over_map",
            title="Path driven" if map is None else "Trajectory over the map",
            caption=_caption(logs[-1], map, None if routes is None else len(planned)),
            content=_draw(logs[-1:], map, grid, plan, planned),
            media_type="image/svg+xml",
            order=10,
        )
        if len(logs) == 1:
            return self.Out(plot=last)
        earlier = Plot(
            name="trajectory_over_map_earlier",
            title="Trajectories of the earlier logs",
            caption="The log before the last one."
            if len(logs) == 2
            else f"The {len(logs) - 1} logs before the last one.",
            content=_draw(logs[:-1], map, grid, plan),
            media_type="image/svg+xml",
            order=13,
        )
        return self.Out(plot=last, earlier=earlier)


def planned_routes(routes: Sequence[PlannedRoute | None], map: AnyMap | None) -> list[Array]:
    """Each route that was planned, in order: x and y (V, 2) of the views along it, and of a goal beside them."""
    found = {route.number: route for route in routes if route is not None and route.number >= 0}
    lines = [_views_along(found[number], map) for number in sorted(found)]
    return [line for line in lines if len(line)]


def _views_along(route: PlannedRoute, map: AnyMap | None) -> Array:
    if isinstance(map, TopologicalMap):
        return map.poses[map.views_along(route.places)[0]][:, :2]
    goal = np.empty((0, 2)) if route.goal is None else np.array([(route.goal.x, route.goal.y)])
    return np.vstack([map_poses(map)[route.places, :2], goal])


def _drives_itself(drive: Drive) -> bool:
    return bool(np.isfinite(drive.distance).any())


def _caption(drive: Drive, map: AnyMap | None, planned: int | None) -> str:
    estimated = known(drive.estimate).any()
    words = [f"The {'estimate' if estimated or not drive.has_truth else 'true path'} of {len(drive)} frames"]
    if not drive.has_truth:
        words.append("; this log has no ground truth.")
    else:
        words.append("over the true path." if estimated else ".")
    if _drives_itself(drive):
        words.append(f"The robot collided {counted(int(drive.collisions.max()), 'time')} (orange crosses).")
    if planned is not None:
        earlier = f", thin: the {planned - 1} before it" if planned > 1 else ""
        words.append(
            f"Green: the route that it planned last{earlier}, and its goal." if planned else "It planned no route."
        )
    if drive.odometry_alone() is not None:
        anchor = "starts at the first true pose" if drive.has_truth else "is laid through the last estimate"
        words.append(f"Odometry alone {anchor}.")
    if isinstance(map, TopologicalMap) and len(map):
        words.append(
            f"Grey: {len(map)} places at their medoids, joined along the images between them, all poses taken from "
            f"{SOURCE_WORDS[map.pose_source]}: the estimate is the most probable place's, turned as the view is."
        )
    elif map is not None and len(map):
        words.append(
            f"Grey: the {len(map)} reference views of the map, their poses taken from {SOURCE_WORDS[map.pose_source]}."
        )
    return " ".join(words).replace(" ;", ";").replace(" .", ".")


def _draw(
    logs: Sequence[Drive],
    map: AnyMap | None,
    grid: OccupancyGrid | None,
    plan: FloorPlan | None,
    planned: Sequence[Array] = (),
) -> bytes:
    kept = [drive.truth if drive.has_truth else drive.estimate for drive in logs]
    extent = extent_of(*kept, map_poses(map), landmarks_of(map), margin=0.05)  # odometry and a lost filter may leave it
    if plan is not None and _drives_itself(logs[-1]):
        extent = (-0.3, plan.width + 0.3, -0.3, plan.depth + 0.3)
    chart = plan_chart(extent)
    for number, route in enumerate(planned):
        chart.base.line(route, "green", 7.0 if number == len(planned) - 1 else 1.8, opacity=0.45)
    draw_landmarks(chart, map)
    draw_surroundings(chart, map, grid, plan)
    for drive in logs:
        odometry = drive.odometry_alone()
        if odometry is not None:
            chart.base.line(odometry, "orange", 1.4, dashed=True)
            chart.name("odometry alone", "orange", "dashes")
        if drive.has_truth:
            chart.base.line(broken(drive.truth, jumps(drive.truth)), "ink", 3.0, opacity=0.75)
            chart.name("ground truth", "ink")
        if known(drive.estimate).any() or not drive.has_truth:
            chart.base.line(broken(drive.estimate, jumps(drive.estimate)), "blue", 1.8)
            chart.base.dots(drive.estimate, "blue", 1.3)
            chart.name("estimate", "blue")
        begins = drive.truth if drive.has_truth else drive.estimate
        if known(begins).any():
            chart.base.square(begins[int(np.argmax(known(begins)))], "green")
            chart.name("start", "green", "square")
        contacts = np.flatnonzero(np.diff(drive.collisions, prepend=0) > 0)
        if len(contacts):
            chart.base.crosses(drive.truth[contacts], "orange")
            chart.name("contact", "orange", "square")
    if planned:
        chart.base.ring(planned[-1][-1], "green", 8.0)
        chart.name("planned route, goal", "green", "ring")
    return chart.svg()

"""Measures whether a robot reached its goal, and at what cost."""

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import networkx
import numpy as np
import numpy.typing as npt

from omninav.pipeline import Context, Metrics, MetricSpec, MetricStage
from omninav.stages.geometry.arrays import Array
from omninav.stages.geometry.plane.se2 import path_length
from omninav.stages.values.drive import Drive, known
from omninav.stages.values.maps import ReferenceGraph
from omninav.stages.values.planned_route import PlannedRoute
from omninav.stages.values.topological_map import TopologicalMap

SPECS = {
    "navigation.reached_rate": MetricSpec(title="Goal reached", better="higher", least=1.0),
    "navigation.goals_reached_rate": MetricSpec(title="Share of the goals reached", better="higher", least=1.0),
    "navigation.collision_free_rate": MetricSpec(title="Goal reached without a collision", better="higher"),
    "navigation.collisions": MetricSpec(title="Collisions", better="lower", most=0.0),
    "navigation.end_error_m": MetricSpec(title="Distance to the goal at the end", better="lower"),
    "navigation.reached_error_m": MetricSpec(title="Distance to the goal, where reached", better="lower"),
    "navigation.path_length_ratio": MetricSpec(title="Path length / shortest path", better="lower"),
    "navigation.time_per_metre_s": MetricSpec(title="Time per metre of the shortest path", better="lower"),
    "navigation.time_s": MetricSpec(title="Time", better="lower"),
    "navigation.path_length_m": MetricSpec(title="Path length"),
    "navigation.shortest_m": MetricSpec(title="Shortest path", context=True),
    "navigation.lost_m_per_km": MetricSpec(title="Metres driven while lost, per kilometre", better="lower"),
    "navigation.routes": MetricSpec(title="Routes planned", better="lower"),
    "navigation.goal": MetricSpec(setting=True),
    "navigation.goals": MetricSpec(setting=True),
    "navigation.state": MetricSpec(title="Route at the end"),
    "navigation.reason": MetricSpec(title="Why it gave up"),
    "navigation.reached": MetricSpec(setting=True),
}
HEADLINES = tuple(
    f"navigation.{name}"
    for name in (
        "goals_reached_rate",
        "reached_rate",
        "state",
        "end_error_m",
        "collisions",
        "time_s",
        "path_length_ratio",
        "routes",
        "reason",
    )
)
ENDS = ("arrived", "gave up")
"""States of a route after which the robot does not drive on."""
WITHIN_M = 0.5
"""Largest distance from the goal at which it is reached, and error of an estimate that is not lost, metres."""


class Navigation(MetricStage):
    """Measures how a drive to a goal ended: the entry `navigation` of metrics.json.

    Of several goals it is the last; `goals` is their number then, and `goals_reached_rate` the share that was reached.
    `reached`: the robot said that it has arrived, close to where the medoid of the route's last place was taken, or to
    the point that is its goal; `end_error_m`: how far from there it ended. `collisions`, in a simulated world;
    `path_length_m`: driven, on a robot by its odometry; `shortest_m`: from where it began along the images of the map,
    the shortest path that it could have known; `time_s`: until it said that it has arrived or given up, else all of it.
    `routes`: how many it planned; `state` and `reason`: what it last said. `reached_rate` and `collision_free_rate`: 1
    or 0, for means over drives.
    Only of drives that reached their goal: `path_length_ratio`, the path driven over the shortest; `time_per_metre_s`,
    seconds for a metre of the shortest; `reached_error_m`, how far from the place it ended. Of a simulated robot that
    knows poses: `lost_m_per_km`, metres per kilometre driven with an estimate more than 0.5 m off, or none, on the way
    to all goals. Truth of the map's poses that is not known gives None. Gives nothing where no route was ever planned
    and no truth is known.
    """

    def step(
        self,
        ctx: Context,
        drive: Drive,
        routes: Sequence[PlannedRoute | None],
        map: TopologicalMap | ReferenceGraph,
    ) -> MetricStage.Out:
        begun = first_of_last_goal(routes)
        planned = [route for route in routes[begun:] if route is not None]
        spots = drive.truth[begun:][known(drive.truth[begun:])][:, :2]
        if not planned or not len(spots):
            return self.Out()
        last, former = planned[-1], routes[begun - 1] if begun else None
        ends = (k for k, route in enumerate(routes[begun:], begun) if route is not None and route.state in ENDS)
        ended = next(ends, len(drive) - 1)
        tallied = np.flatnonzero(np.isfinite(drive.distance))
        before = tallied[tallied <= begun][-1:] if begun else tallied[:0]
        collisions = None
        driven = float(np.nansum(np.hypot(*drive.motion[begun + 1 if begun else 0 :, :2].T)))
        if len(tallied):
            collisions = int(drive.collisions[tallied[-1]] - drive.collisions[before].sum())
            driven = float(drive.distance[tallied[-1]] - drive.distance[before].sum())
        goal = int(last.places[-1]) if len(last.places) else None
        end_error = shortest = None
        if map.pose_source == "truth":
            end_error = metres_to_goal(map, spots[-1], last)
        if end_error is not None and isinstance(map, ReferenceGraph):
            shortest = metres_of_first(map, spots[0], planned)
        elif end_error is not None and isinstance(map, TopologicalMap) and goal is not None:
            shortest = shortest_metres(map, spots[0], goal)
        values: dict[str, Any] = {} if collisions is None else {"collisions": collisions}
        values |= {
            "end_error_m": end_error,
            "path_length_m": driven,
            "shortest_m": shortest,
            "time_s": float(drive.seconds[ended] - (drive.seconds[begun] if begun else 0.0)),
            "routes": last.number - (former.number if former else -1),
            "goal": goal,
            "state": last.state,
            "reason": last.why or None,
        }
        if map.pose_source == "truth":
            of_goals = goals_reached(drive, routes, map)
            reached = of_goals[0]
            values |= {"reached": reached, "reached_rate": float(reached)}
            if collisions is not None:
                values["collision_free_rate"] = float(reached and collisions == 0)
            if reached:
                values["reached_error_m"] = end_error
            if reached and shortest:
                values["time_per_metre_s"] = values["time_s"] / shortest
                values["path_length_ratio"] = driven / shortest
            if len(of_goals) > 1:
                values |= {"goals": len(of_goals), "goals_reached_rate": float(np.mean(of_goals))}
        if len(tallied) and map.pose_source == "truth" and isinstance(map, ReferenceGraph):
            values["lost_m_per_km"] = lost_metres(drive)
        return self.Out(metrics=Metrics({"navigation": values}, SPECS, HEADLINES, foremost=True))


def goals_reached(
    drive: Drive, routes: Sequence[PlannedRoute | None], map: TopologicalMap | ReferenceGraph
) -> list[bool]:
    """Tell of each goal, from the last back to the first, whether it was reached; in a map of true poses."""
    found, end = [], len(routes)
    while end:
        begun = first_of_last_goal(routes[:end])
        planned = [route for route in routes[begun:end] if route is not None]
        truth = drive.truth[begun:end]
        spots = truth[known(truth)][:, :2]
        error = metres_to_goal(map, spots[-1], planned[-1]) if planned and len(spots) else None
        found.append(error is not None and error <= WITHIN_M and planned[-1].state == "arrived")
        end = begun
    return found


def metres_to_goal(map: TopologicalMap | ReferenceGraph, spot: Array, route: PlannedRoute) -> float | None:
    """Distance (m) of a point (x, y) from a route's goal; None where it has none."""
    if isinstance(map, ReferenceGraph):
        return None if route.goal is None else math.dist(spot, (route.goal.x, route.goal.y))
    return math.dist(spot, map.poses[map.places[route.places[-1]]][:2]) if len(route.places) else None


def lost_metres(drive: Drive) -> float | None:
    """Metres of a kilometre that were driven from ticks whose estimate was too far off; None where it did not move."""
    steps = np.diff(drive.distance)
    lost = ~(np.hypot(*(drive.estimate - drive.truth)[:-1, :2].T) <= WITHIN_M)
    return 1000.0 * float(steps[lost].sum() / steps.sum()) if steps.sum() > 0.0 else None


def first_of_last_goal(routes: Sequence[PlannedRoute | None]) -> int:
    """The tick from which on all routes lead to the goal of the last one: 0, where there was no other."""
    last: int | None = None
    for k in range(len(routes) - 1, -1, -1):
        route = routes[k]
        if route is None or (route.goal is None and not len(route.places)):
            continue
        goal = int(route.places[-1]) if route.goal is None else route.asked
        if last is not None and goal != last:
            return k + 1
        last = goal
    return 0


def metres_of_first(map: ReferenceGraph, start: Array, routes: Sequence[PlannedRoute]) -> float | None:
    """Metres from a point (x, y) along the references of the first route, and on to its goal; None without a route."""
    first = next((route for route in routes if route.number >= 0 and route.goal is not None), None)
    if first is None or first.goal is None:
        return None
    return path_length(np.vstack([start, map.poses[first.places, :2], (first.goal.x, first.goal.y)]))


def shortest_metres(map: TopologicalMap, start: npt.ArrayLike, goal: int) -> float | None:
    """Metres from a point (x, y) to a place, straight to the closest view and from there along the map's.

    None where no path leads there.
    """
    spots = map.poses[:, :2]
    graph = networkx.Graph()
    graph.add_nodes_from(range(len(spots)))
    for link in range(len(map.links)):
        steps = pairwise(map.whole_way(link).tolist())
        graph.add_edges_from((a, b, {"metres": math.dist(spots[a], spots[b])}) for a, b in steps)
    lengths = networkx.single_source_dijkstra_path_length(graph, int(map.places[goal]), weight="metres")
    ahead = np.hypot(*(spots - np.asarray(start, np.float64)).T)
    there = [float(ahead[view]) + metres for view, metres in lengths.items()]
    nearest = int(np.argmin(ahead))
    return float(ahead[nearest]) + lengths[nearest] if nearest in lengths else min(there, default=None)

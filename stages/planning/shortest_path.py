"""The shortest route over a topological map to a goal, as images to drive along."""

import shlex
from dataclasses import field
from typing import Annotated, Literal

import networkx
import numpy as np

from omninav.pipeline import BadInput, Bounds, Context, Outputs, Stage, State, Tick, nearest
from omninav.stages.geometry.arrays import Array, Bools, Ints
from omninav.stages.values.belief import PlaceBelief
from omninav.stages.values.commands import GOAL_TOPIC, GoalPoint
from omninav.stages.values.homing import DrivingStatus, ImagePath, PathProgress
from omninav.stages.values.planned_route import PlannedRoute
from omninav.stages.values.topological_map import TopologicalMap
from omninav.stages.values.visual_distance import VisualDistances

MAX_VISUAL_DISTANCE = 0.5
"""Largest visual distance between a goal's image and its place: the paper's size of places."""
MIN_PROBABILITY = 0.5
"""Smallest probability of the most probable place to plan from it."""
SETTLE_S = 1.0
"""Time for which the robot looks before it plans, even if it is sure, seconds."""
LOCATE_TIMEOUT_S = 5.0
"""Time after which it plans even if it is not sure, seconds."""
MAX_FAILURES = 3
"""Failures of a link after which it is closed."""


class ShortestPathPlannerState(State):
    """The route so far: its number and places, and how many of its views lead to each place.

    `planned`: routes to this goal so far; `waiting_since` (ns): since when there has been reason to plan, None: there
    is none. `failed_links` (F, 2): the links on which they have failed, a place with itself for its own medoid, with
    which a route begins; `failures` (F,): how often. `why`: the last reason to plan, `blocked`: the last reason why the
    way was blocked; `ended`: how the route ended, "" if it has not. `asked`: the place that was named since (-1:
    none has), and whether that is still to be planned for (`renewed`).
    """

    number: int = -1
    places: Ints = field(default_factory=lambda: np.zeros(0, np.int64))
    views: Ints = field(default_factory=lambda: np.zeros(0, np.int64))
    planned: int = 0
    waiting_since: int | None = None
    failed_links: Ints = field(default_factory=lambda: np.zeros((0, 2), np.int64))
    failures: Ints = field(default_factory=lambda: np.zeros(0, np.int64))
    ended: str = ""
    asked: int = -1
    renewed: bool = False
    why: str = ""
    blocked: str = ""


class ShortestPathPlanner(Stage):
    """Plans the shortest route from the most probable place to the goal, as the images along it.

    Goedemé et al. 2007, section 6 (Dijkstra's algorithm): the medoid of the place where the robot is believed to be,
    the path images of each link, and the medoids between them; the robot stops at the goal's medoid.

    It plans once the belief is sure enough or has had time enough, and again where the robot has lost its target or
    finds its way blocked. Routes without the link on which that happened are then preferred, and a link that has failed
    too often is closed. A robot that is lost before it has come to the first view of its route is perhaps elsewhere:
    each time it is half as likely to be at that place, and every other route from there begins behind the medoid. Lost
    again where it has been lost before, it looks around before it plans. After too many routes, or where no route is
    left, the planner gives up with the reason and an empty path, so that the robot stops. Raises BadInput for a goal
    that the map does not have, and for an image of no place in it.
    """

    goal: str | int | None = None
    """A place's number or name (of several of that name the nearest), or an image file: the place that looks most like
    it. `/goal_pose`: a `point` comes later."""
    search_s: Annotated[float, Bounds(ge=0)] = 15.0
    """Time for which a robot that is lost again on the same link, or again as it sets out from the same place, looks
    around (it stops, then wanders) before it plans; sure of another place, it plans at once."""
    max_routes: Annotated[int, Bounds(ge=1)] = 20
    """Routes after which the planner gives up."""

    class Out(Outputs):
        """`path`: the views, in the tick in which they are planned. `route`: through which places, at every tick."""

        path: ImagePath | None = None
        route: PlannedRoute

    def step(
        self,
        ctx: Context,
        state: ShortestPathPlannerState,
        tick: Tick,
        belief: PlaceBelief,
        map: TopologicalMap,
        image: VisualDistances | None = None,
        status: DrivingStatus | None = None,
        progress: PathProgress | None = None,
        point: GoalPoint | None = None,
    ) -> Out:
        """Plan where there is reason to; `status` and `progress` are those of the tick before.

        `image`: how far the goal's image is from each place, where the goal is one. `point`: where a running robot is
        asked to go instead; it goes to the place whose medoid is nearest to it.
        """
        if tick.first_of_log:  # its clock may be behind that of the one before
            state.waiting_since = None
        if point is not None:
            medoids = map.poses[map.places][:, :2]
            state.asked = int(np.argmin(np.hypot(*(medoids - (point.x, point.y)).T)))
            state.renewed, state.ended, state.waiting_since, state.blocked = True, "", None, ""
            state.planned, state.failures = 0, np.zeros(0, np.int64)
            state.failed_links = np.zeros((0, 2), np.int64)
        if state.asked >= 0:
            goals = np.array([state.asked], np.int64)
        elif self.goal == GOAL_TOPIC:
            return self.Out(route=_route(state))
        elif image is not None:
            goals = place_in_image(self.goal, image, MAX_VISUAL_DISTANCE, map)
        else:
            goals = places_called(self.goal, map)
        if state.ended or not self._must_plan(state, tick, belief, status, progress):
            return self.Out(route=_route(state))
        if state.number >= 0 and not state.renewed and progress is not None and status is not None:
            failing = _failing(state, progress.at, lost=status.state == "lost")
            if status.state == "lost" or failing[0] != failing[1]:  # blocked, it may well be where it believes to be
                _remember(state, failing)
            state.blocked = status.why if status.state == "blocked" else state.blocked
        path = self._plan(ctx, state, belief.probabilities, goals, map)
        return self.Out(path=path, route=_route(state))

    def _must_plan(
        self,
        state: ShortestPathPlannerState,
        tick: Tick,
        belief: PlaceBelief,
        status: DrivingStatus | None,
        progress: PathProgress | None,
    ) -> bool:
        if state.number < 0 or state.renewed:
            state.why = "it has no route yet"
        elif progress is None or progress.path != state.number:  # the path has not reached path_following yet
            return False
        elif progress.arrived:
            state.ended, state.why = "arrived", ""
            return False
        elif status is None or status.state not in ("lost", "blocked"):
            state.waiting_since, state.why = None, ""
            if progress.at > 0:  # it was right about where it is
                _forget_medoids(state)
            return False
        else:
            state.why = f"{status.state}: {status.why}"
        if state.waiting_since is None:
            state.waiting_since = tick.stamp
        waited_s = (tick.stamp - state.waiting_since) / 1e9
        failing = _failing(state, progress.at, lost=True) if progress is not None and state.number >= 0 else None
        if failing is not None and status is not None and status.state == "lost" and _same(state, failing).any():
            place, _ = _likeliest(belief.probabilities, state)
            elsewhere = place not in failing and belief.probabilities[place] >= MIN_PROBABILITY
            return bool(elsewhere and waited_s >= SETTLE_S) or waited_s >= self.search_s
        sure = belief.probabilities.max() >= MIN_PROBABILITY and waited_s >= SETTLE_S
        return bool(sure) or waited_s >= LOCATE_TIMEOUT_S

    def _plan(
        self, ctx: Context, state: ShortestPathPlannerState, probabilities: Array, goals: Ints, map: TopologicalMap
    ) -> ImagePath:
        place, missed = _likeliest(probabilities, state)
        places = shortest_route(map, place, goals, state.failed_links, state.failures)
        last = f"the last route ended because it was {state.why}"
        if state.blocked and not state.why.startswith("blocked"):
            last = f"it was blocked: {state.blocked}; {last}"
        if state.planned >= self.max_routes:
            return _given_up(state, f"{self.max_routes} routes were tried; {last}")
        if not len(places):
            closed = state.failed_links[state.failures >= MAX_FAILURES].tolist()
            shut = ", ".join(f"{one} to {other}" for one, other in closed if one != other)
            why = f" but what could not be driven {MAX_FAILURES} times, from place {shut}; {last}" if shut else ""
            return _given_up(state, f"no route leads from place {place} to {self.goal}{why}")
        views, ends = map.views_along(places)
        if missed % 2 and len(places) > 1:
            views, ends = views[1:], ends - 1
        state.number, state.planned, state.waiting_since = state.number + 1, state.planned + 1, None
        state.places, state.views, state.why, state.renewed = places, ends, "", False
        names = tuple(_called(map, int(view)) for view in views)
        return ImagePath(state.number, tuple(map.views.features(int(view)) for view in views), names)


def places_called(goal: str | int | None, map: TopologicalMap) -> Ints:
    """The places that a goal names. Raises BadInput where the map has none."""
    text = "" if goal is None else str(goal).strip()
    found = map.named(text) if text else np.zeros(0, np.int64)
    if not len(found) and text.isdecimal() and int(text) < len(map):
        found = np.array([int(text)], np.int64)
    if len(found):
        return found
    names = sorted({name for name in map.names if name})
    known = f"its names are {', '.join(names)}" if names else "its places have no names"
    what = f"the map has no place '{text}'" if text else "no goal is named"
    example = shlex.quote(f"goal={nearest(text, names) or names[0]}") if names else "goal=0"
    raise BadInput(f"goal: {what}; type {example} or a number below {len(map)} ({known})")


def place_in_image(
    goal: str | int | None, image: VisualDistances, max_visual_distance: float, map: TopologicalMap
) -> Ints:
    """The place that an image shows, by its visual distances. Raises BadInput where even the nearest is too far."""
    nearest = int(np.argmin(image.distances))
    distance = float(image.distances[nearest])
    if distance <= max_visual_distance:
        return np.array([nearest], np.int64)
    name = f", {map.names[nearest]}" if map.names[nearest] else ""
    so = f"the nearest is place {nearest}{name}, at a visual distance of {distance:.2f}"
    so += f", where {max_visual_distance:g} is allowed"
    if np.isinf(distance):
        so = "it has too little in common with any"
    raise BadInput(f"goal: {goal} is of no place of the map: {so}; give an image from closer to where the map was made")


def shortest_route(
    map: TopologicalMap,
    place: int,
    goals: Ints,
    failed_links: Ints,
    failures: Ints,
) -> Ints:
    """The places from `place` to the nearest of `goals` (G,), both included: (K,); none where no route is left.

    `failed_links` (F, 2): pairs of places between which it has failed to drive, `failures` (F,) times: any route around
    them is preferred, and those that failed `MAX_FAILURES` times are closed. Equally short routes: that of the
    first link.
    """
    graph = networkx.Graph()
    graph.add_nodes_from(range(len(map)))
    failed = {frozenset(pair): number for pair, number in zip(failed_links.tolist(), failures.tolist(), strict=True)}
    for one, other in map.links.tolist():
        missed = failed.get(frozenset((one, other)), 0)
        if one != other and missed < MAX_FAILURES:
            price = 1 + missed * len(map.views)
            known = graph.edges[one, other]["price"] if graph.has_edge(one, other) else price
            graph.add_edge(one, other, price=min(price, known))
    lengths, routes = networkx.single_source_dijkstra(graph, place, weight="price")
    reached = [(lengths[goal], goal) for goal in goals.tolist() if goal in lengths]
    return np.array(routes[min(reached)[1]] if reached else [], np.int64)


def _likeliest(probabilities: Array, state: ShortestPathPlannerState) -> tuple[int, int]:
    """Most probable place of the robot, and how often it was lost as it set out from there."""
    missed = np.zeros(len(probabilities), np.int64)
    own = state.failed_links[:, 0] == state.failed_links[:, 1]
    missed[state.failed_links[own, 0]] = state.failures[own]
    place = int(np.argmax(probabilities * 0.5**missed))
    return place, int(missed[place])


def _failing(state: ShortestPathPlannerState, reached: int, lost: bool) -> Ints:
    """The link on which a route fails behind this many of its views; lost before the first, its place with itself."""
    if lost and not reached:
        return state.places[[0, 0]]
    leg = max(1, int(np.searchsorted(state.views, reached, side="right")))
    return state.places[[leg - 1, min(leg, len(state.places) - 1)]]


def _same(state: ShortestPathPlannerState, pair: Ints) -> Bools:
    """Which of the failed links it is, in whichever direction."""
    return np.asarray((np.sort(state.failed_links, axis=1) == np.sort(pair)).all(axis=1))


def _remember(state: ShortestPathPlannerState, pair: Ints) -> None:
    same = _same(state, pair)
    if same.any():
        state.failures = state.failures + same
    else:
        state.failed_links = np.vstack([state.failed_links, pair])
        state.failures = np.append(state.failures, 1)


def _forget_medoids(state: ShortestPathPlannerState) -> None:
    links = state.failed_links[:, 0] != state.failed_links[:, 1]
    state.failed_links, state.failures = state.failed_links[links], state.failures[links]


def _given_up(state: ShortestPathPlannerState, why: str) -> ImagePath:
    state.ended, state.why, state.renewed = "gave up", why, False
    return ImagePath(state.number + 1, (), ())


def _called(map: TopologicalMap, view: int) -> str:
    place = int(map.owner[view])
    named = f"place {place}" + (f", {map.names[place]}" if map.names[place] else "")
    return named if int(map.places[place]) == view else f"on the way, image {int(map.frames[view])}"


def _route(state: ShortestPathPlannerState) -> PlannedRoute:
    now: Literal["locating", "under way", "arrived", "gave up"] = "under way"
    if state.ended:
        now = "arrived" if state.ended == "arrived" else "gave up"
    elif state.number < 0 or state.waiting_since is not None:
        now = "locating"
    return PlannedRoute(state.places, now, state.number, state.why)

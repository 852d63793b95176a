"""The shortest way over a topological map to a goal, as pictures to drive along."""

import shlex
from dataclasses import field
from typing import Annotated, Literal

import networkx
import numpy as np
import numpy.typing as npt

from omninav.pipeline import Bounds, Context, Outputs, Stage, State
from omninav.pipeline.graph.problems import BadInput, nearest
from omninav.stages.values.belief import PlaceBelief
from omninav.stages.values.homing import DrivingStatus, ImagePath, PathProgress
from omninav.stages.values.planned_route import PlannedRoute
from omninav.stages.values.topological_map import TopologicalMap
from omninav.stages.values.visual_distance import VisualDistances

Array = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]


def _no_place() -> Ints:
    return np.zeros(0, np.int64)


class Itinerary(State):
    """The way so far: its number and places, how many views of it lead to each place, ways planned, ticks waited.

    `failed` (F, 2): the links on which ways have failed, a place with itself for its own medoid, with which a way
    begins; `times` (F,): how often. `why`: the last reason, `blocked`: the last one for which it was blocked; `ended`:
    how it ended, "" if it has not.
    """

    number: int = -1
    places: Ints = field(default_factory=_no_place)
    views: Ints = field(default_factory=_no_place)
    planned: int = 0
    waited: int = 0
    failed: Ints = field(default_factory=lambda: np.zeros((0, 2), np.int64))
    times: Ints = field(default_factory=_no_place)
    ended: str = ""
    why: str = ""
    blocked: str = ""


class ShortestPathPlanner(Stage):
    """From the most probable place to the goal over as few links as there are, as the pictures along that way.

    Goedemé et al. 2007, section 6 (Dijkstra's algorithm): the medoid of the place where the robot is believed to be,
    the path images of each link, and the medoids between them; the goal's medoid is where it stops. `goal`: a place's
    number or name (of several of that name the nearest), or a picture: the place with the least visual distance to
    it, which may be `alike` at most. `cost`: a link counts one (`links`, the paper's) or as many as views have to be
    driven to (`views`).

    It plans once the robot is `sure` where it is, by the belief's share, for `calm` ticks, or has looked for `patience`
    ticks; and again where the robot has lost its target, or found its way blocked. Ways without the link on which that
    happened are then preferred, and one that has failed `again` times is closed. Where it is a place's own medoid
    that the robot did not come to, it is half as likely to be there, and the next way from there begins behind it.
    After `tries` ways, or where no way is left, it gives up: it says why, and gives an empty path, so that the robot
    stands. Raises BadInput for a goal that the map does not have, and for a picture of no place in it.
    """

    goal: str | int | None = None
    alike: Annotated[float, Bounds(gt=0)] = 0.5
    cost: Literal["links", "views"] = "links"
    sure: Annotated[float, Bounds(gt=0, le=1)] = 0.5
    calm: Annotated[int, Bounds(ge=0)] = 5
    patience: Annotated[int, Bounds(ge=1)] = 25
    again: Annotated[int, Bounds(ge=1)] = 3
    tries: Annotated[int, Bounds(ge=1)] = 20

    class Out(Outputs):
        """`path`: the views, in the tick in which they are planned. `way`: through which places, at every tick."""

        path: ImagePath | None = None
        route: PlannedRoute

    def step(
        self,
        ctx: Context,
        itinerary: Itinerary,
        belief: PlaceBelief,
        map: TopologicalMap,
        image: VisualDistances | None = None,
        status: DrivingStatus | None = None,
        progress: PathProgress | None = None,
    ) -> Out:
        """Plan where there is reason to; `status` and `progress` are those of the tick before.

        `picture`: how far the goal's picture is from each place, where the goal is one.
        """
        pictured = None if image is None else place_pictured(self.goal, image, self.alike, map)
        goals = places_called(self.goal, map) if pictured is None else pictured
        if itinerary.ended or not self._must_plan(itinerary, belief, status, progress):
            return self.Out(route=_way(itinerary))
        if itinerary.number >= 0 and progress is not None and status is not None:
            _remember(itinerary, progress.at)
            itinerary.blocked = status.why if status.state == "blocked" else itinerary.blocked
        path = self._plan(ctx, itinerary, belief.probabilities, goals, map)
        return self.Out(path=path, route=_way(itinerary))

    def _must_plan(
        self, itinerary: Itinerary, belief: PlaceBelief, status: DrivingStatus | None, progress: PathProgress | None
    ) -> bool:
        if itinerary.number < 0:
            itinerary.why = "it has no way yet"
        elif progress is None or progress.path != itinerary.number:  # the way has not reached who drives it
            return False
        elif progress.arrived:
            itinerary.ended, itinerary.why = "arrived", ""
            return False
        elif status is None or status.state not in ("lost", "blocked"):
            itinerary.waited, itinerary.why = 0, ""
            if progress.at > 0:  # it was right about where it is
                _forget_medoids(itinerary)
            return False
        else:
            itinerary.why = f"{status.state}: {status.why}"
        itinerary.waited += 1
        sure = belief.probabilities.max() >= self.sure and itinerary.waited > self.calm
        return bool(sure) or itinerary.waited > self.patience

    def _plan(
        self, ctx: Context, itinerary: Itinerary, probabilities: Array, goals: Ints, map: TopologicalMap
    ) -> ImagePath:
        place, missed = _likeliest(probabilities, itinerary)
        places = shortest_way(map, place, goals, self.cost, itinerary.failed, itinerary.times, self.again)
        last = f"the last way ended because it was {itinerary.why}"
        if itinerary.blocked and not itinerary.why.startswith("blocked"):
            last = f"it was blocked: {itinerary.blocked}; {last}"
        if itinerary.planned >= self.tries:
            return _given_up(itinerary, f"{self.tries} ways were tried; {last}")
        if not len(places):
            closed = itinerary.failed[itinerary.times >= self.again].tolist()
            shut = ", ".join(f"{one} to {other}" for one, other in closed if one != other)
            why = f" but what could not be driven {self.again} times, from place {shut}; {last}" if shut else ""
            return _given_up(itinerary, f"no way leads from place {place} to {self.goal}{why}")
        views, ends = map.views_along(places)
        if missed % 2 and len(places) > 1:
            views, ends = views[1:], ends - 1
        itinerary.number, itinerary.planned, itinerary.waited = itinerary.number + 1, itinerary.planned + 1, 0
        itinerary.places, itinerary.views, itinerary.why = places, ends, ""
        names = tuple(_called(map, int(view)) for view in views)
        return ImagePath(itinerary.number, tuple(map.views.features(int(view)) for view in views), names)


def places_called(goal: str | int | None, map: TopologicalMap) -> Ints:
    """The places that a goal names. Raises BadInput where the map has none."""
    text = "" if goal is None else str(goal).strip()
    found = map.named(text) if text else _no_place()
    if not len(found) and text.isdecimal() and int(text) < len(map):
        found = np.array([int(text)], np.int64)
    if len(found):
        return found
    names = sorted({name for name in map.names if name})
    known = f"its names are {', '.join(names)}" if names else "its places have no names"
    what = f"the map has no place '{text}'" if text else "no goal is named"
    example = shlex.quote(f"goal={nearest(text, names) or names[0]}") if names else "goal=0"
    raise BadInput(f"goal: {what}; type {example} or a number below {len(map)} ({known})")


def place_pictured(goal: str | int | None, picture: VisualDistances, alike: float, map: TopologicalMap) -> Ints:
    """The place that a picture is of, by its visual distances. Raises BadInput where the nearest is not `alike`."""
    nearest = int(np.argmin(picture.distances))
    apart = float(picture.distances[nearest])
    if apart <= alike:
        return np.array([nearest], np.int64)
    name = f", {map.names[nearest]}" if map.names[nearest] else ""
    so = f"the nearest is place {nearest}{name}, at a visual distance of {apart:.2f}, where {alike:g} is allowed"
    if np.isinf(apart):
        so = "it has too little in common with any"
    raise BadInput(
        f"goal: {goal} is of no place of the map: {so}; give a picture from closer to where the map was made"
    )


def shortest_way(
    map: TopologicalMap,
    place: int,
    goals: Ints,
    cost: Literal["links", "views"],
    failed: Ints,
    times: Ints,
    again: int,
) -> Ints:
    """The places from `place` to the nearest of `goals` (G,), both included: (K,); none where no way is left.

    `failed` (F, 2): pairs of places between which it has failed to go, `times` (F,) often: any way around them is
    preferred, and those that failed `again` times are closed. Equally short ways: that of lower numbers.
    """
    graph = networkx.Graph()
    graph.add_nodes_from(range(len(map)))
    failures = {frozenset(pair): number for pair, number in zip(failed.tolist(), times.tolist(), strict=True)}
    for link, (one, other) in enumerate(map.links.tolist()):
        missed = failures.get(frozenset((one, other)), 0)
        if one != other and missed < again:
            price = (1 if cost == "links" else 1 + len(map.way(link))) + missed * len(map.views)
            known = graph.edges[one, other]["price"] if graph.has_edge(one, other) else price
            graph.add_edge(one, other, price=min(price, known))
    lengths, ways = networkx.single_source_dijkstra(graph, place, weight="price")
    reached = [(lengths[goal], goal) for goal in goals.tolist() if goal in lengths]
    return np.array(ways[min(reached)[1]] if reached else [], np.int64)


def _likeliest(probabilities: Array, itinerary: Itinerary) -> tuple[int, int]:
    """Where the robot most probably is, and how often it did not come to the medoid there."""
    missed = np.zeros(len(probabilities), np.int64)
    own = itinerary.failed[:, 0] == itinerary.failed[:, 1]
    missed[itinerary.failed[own, 0]] = itinerary.times[own]
    place = int(np.argmax(probabilities * 0.5**missed))
    return place, int(missed[place])


def _remember(itinerary: Itinerary, reached: int) -> None:
    """That the way failed behind so many of its views: on which link."""
    leg = int(np.searchsorted(itinerary.views, reached, side="right"))
    pair = itinerary.places[[max(leg - 1, 0), min(leg, len(itinerary.places) - 1)]]
    same = (np.sort(itinerary.failed, axis=1) == np.sort(pair)).all(axis=1)
    if same.any():
        itinerary.times = itinerary.times + same
    else:
        itinerary.failed, itinerary.times = np.vstack([itinerary.failed, pair]), np.append(itinerary.times, 1)


def _forget_medoids(itinerary: Itinerary) -> None:
    links = itinerary.failed[:, 0] != itinerary.failed[:, 1]
    itinerary.failed, itinerary.times = itinerary.failed[links], itinerary.times[links]


def _given_up(itinerary: Itinerary, why: str) -> ImagePath:
    itinerary.ended, itinerary.why = "gave up", why
    return ImagePath(itinerary.number + 1, (), ())


def _called(map: TopologicalMap, view: int) -> str:
    place = int(map.owner[view])
    named = f"place {place}" + (f", {map.names[place]}" if map.names[place] else "")
    return named if int(map.places[place]) == view else f"on the way, picture {int(map.frames[view])}"


def _way(itinerary: Itinerary) -> PlannedRoute:
    state: Literal["locating", "under way", "arrived", "gave up"] = "under way"
    if itinerary.ended:
        state = "arrived" if itinerary.ended == "arrived" else "gave up"
    elif itinerary.number < 0 or itinerary.waited > 0:
        state = "locating"
    return PlannedRoute(itinerary.places, state, itinerary.number, itinerary.why)

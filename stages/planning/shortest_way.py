"""The shortest way over a topological map to a goal, as pictures to drive along."""

from dataclasses import field
from typing import Annotated, Literal

import networkx
import numpy as np
import numpy.typing as npt

from omninav.pipeline import Bounds, Context, Outputs, Stage, State
from omninav.pipeline.problems import BadInput
from omninav.stages.values.belief import PlaceBelief
from omninav.stages.values.homing import DrivingStatus, ImagePath, PathProgress
from omninav.stages.values.planned_way import PlannedWay
from omninav.stages.values.topological_map import TopologicalMap

Ints = npt.NDArray[np.int64]


def _no_place() -> Ints:
    return np.zeros(0, np.int64)


class Itinerary(State):
    """The way so far: its number and places, how many views of it lead to each place, ways planned, ticks waited, links
    that were found blocked (B, 2), and how it ended."""

    number: int = -1
    places: Ints = field(default_factory=_no_place)
    views: Ints = field(default_factory=_no_place)
    planned: int = 0
    waited: int = 0
    closed: Ints = field(default_factory=lambda: np.zeros((0, 2), np.int64))
    ended: str = ""
    why: str = ""


class ShortestWay(Stage):
    """From the most probable place to the goal over as few links as there are, as the pictures along that way.

    Goedemé et al. 2007, section 6 (Dijkstra's algorithm): the medoid of the place where the robot is believed to be,
    the path images of each link, and the medoids between them; the goal's medoid is where it stops. `goal`: a place's
    number or name (of several of that name the nearest). `cost`: a link counts one (`links`, the paper's) or as many as
    views have to be driven to (`views`).

    It plans once the robot is `sure` where it is, by the belief's share, or has looked for `patience` ticks; and again
    where the robot has lost its target, or found its way blocked: then without the link it was on. After `tries` ways,
    or where no way is left, it gives up and says why. Raises BadInput for a goal that the map does not have.
    """

    goal: str | int | None = None
    cost: Literal["links", "views"] = "links"
    sure: Annotated[float, Bounds(gt=0, le=1)] = 0.5
    patience: Annotated[int, Bounds(ge=1)] = 25
    tries: Annotated[int, Bounds(ge=1)] = 10

    class Out(Outputs):
        """`path`: the views, in the tick in which they are planned. `way`: through which places, at every tick."""

        path: ImagePath | None = None
        way: PlannedWay

    def step(
        self,
        ctx: Context,
        itinerary: Itinerary,
        belief: PlaceBelief,
        map: TopologicalMap,
        status: DrivingStatus | None = None,
        progress: PathProgress | None = None,
    ) -> Out:
        """Plan where there is reason to; `status` and `progress` are those of the tick before."""
        goals = places_called(self.goal, map)
        if not itinerary.ended and (reason := self._reason(itinerary, status, progress)):
            itinerary.why, itinerary.waited = reason, itinerary.waited + 1
            if belief.probabilities.max() >= self.sure or itinerary.waited > self.patience:
                path = self._plan(ctx, itinerary, int(np.argmax(belief.probabilities)), goals, map)
                return self.Out(path=path, way=_way(itinerary))
        return self.Out(way=_way(itinerary))

    def _reason(self, itinerary: Itinerary, status: DrivingStatus | None, progress: PathProgress | None) -> str:
        if itinerary.number < 0:
            return "it has no way yet"
        if progress is None or progress.path != itinerary.number:  # the way has not reached who drives it
            return ""
        if progress.arrived:
            itinerary.ended, itinerary.why = "arrived", ""
        elif itinerary.waited and status is not None and status.state in ("lost", "blocked"):
            return itinerary.why
        elif status is not None and status.state in ("lost", "blocked"):
            if status.state == "blocked":
                itinerary.closed = np.vstack([itinerary.closed, _under_way(itinerary, progress.at)])
            return f"{status.state}: {status.why}"
        else:
            itinerary.waited = 0
        return ""

    def _plan(
        self, ctx: Context, itinerary: Itinerary, place: int, goals: Ints, map: TopologicalMap
    ) -> ImagePath | None:
        if itinerary.planned >= self.tries:
            itinerary.ended = "gave up"
            itinerary.why = f"{self.tries} ways were tried; the last ended because it was {itinerary.why}"
            return None
        places = shortest_way(map, place, goals, self.cost, itinerary.closed)
        if not len(places):
            itinerary.ended = "gave up"
            blocked = f", and {len(itinerary.closed)} links were blocked" if len(itinerary.closed) else ""
            itinerary.why = f"no way leads from place {place} to {self.goal}{blocked}"
            return None
        ctx.count("ways_planned")
        views, ends = map.views_along(places)
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
    example = names[0] if names else "0"
    raise BadInput(f"goal: {what}; type goal={example} or a number below {len(map)} ({known})")


def shortest_way(map: TopologicalMap, place: int, goals: Ints, cost: Literal["links", "views"], closed: Ints) -> Ints:
    """The places from `place` to the nearest of `goals` (G,), both included: (K,); none where no way is left.

    `closed` (B, 2): pairs of places between which there is no way today. Equally short ways: that of lower numbers.
    """
    graph = networkx.Graph()
    graph.add_nodes_from(range(len(map)))
    shut = {frozenset(pair) for pair in closed.tolist()}
    for link, (one, other) in enumerate(map.links.tolist()):
        if one != other and frozenset((one, other)) not in shut:
            price = 1 if cost == "links" else 1 + len(map.way(link))
            known = graph.edges[one, other]["price"] if graph.has_edge(one, other) else price
            graph.add_edge(one, other, price=min(price, known))
    lengths, ways = networkx.single_source_dijkstra(graph, place, weight="price")
    reached = [(lengths[goal], goal) for goal in goals.tolist() if goal in lengths]
    return np.array(ways[min(reached)[1]] if reached else [], np.int64)


def _under_way(itinerary: Itinerary, reached: int) -> Ints:
    """The link that the robot is on when it has reached so many views, as one row; none on its way to the first."""
    leg = int(np.searchsorted(itinerary.views, reached, side="right"))
    inside = 0 < leg < len(itinerary.places)
    return itinerary.places[leg - 1 : leg + 1].reshape(1, 2) if inside else np.zeros((0, 2), np.int64)


def _called(map: TopologicalMap, view: int) -> str:
    place = int(map.owner[view])
    named = f"place {place}" + (f", {map.names[place]}" if map.names[place] else "")
    return named if int(map.places[place]) == view else f"on the way, picture {int(map.frames[view])}"


def _way(itinerary: Itinerary) -> PlannedWay:
    state: Literal["locating", "under way", "arrived", "gave up"] = "under way"
    if itinerary.ended:
        state = "arrived" if itinerary.ended == "arrived" else "gave up"
    elif itinerary.number < 0 or itinerary.waited:
        state = "locating"
    return PlannedWay(itinerary.places, state, itinerary.number, itinerary.why)

"""Makes a topological map of the places of a tour."""

import dataclasses
import math
from collections.abc import Callable
from typing import Annotated, Literal

import numpy as np

from omninav.pipeline import Bounds, Context, Outputs, Stage
from omninav.stages.geometry.appearance import place_clusters
from omninav.stages.geometry.appearance.visual_distance import Patches, compare, match_patches
from omninav.stages.geometry.arrays import Array, Ints
from omninav.stages.values.compared_views import ComparedViews
from omninav.stages.values.local_features import LocalFeatures, view_features
from omninav.stages.values.rooms import Rooms
from omninav.stages.values.topological_map import DRIVEN, LOOP, LoopHypotheses, TopologicalMap, stored

from .pose_of_view import warn_of_few

MAX_PATH_STEP = 5
"""Views of the drive from one path image to the next, the paper's 1 to 5 m."""
WINDOW = 3
"""Views before and after, in which a patch should be found again."""


class TopologicalMapping(Stage):
    """Makes a topological map: places with their medoids, and links with path images between successive places.

    Goedemé et al. 2007, sections 4.1 and 6. Of each view those patches are kept that were found again in most of the
    views around it, and the heaviest vertical segments. On the way from place to place path images are kept, each with
    enough matches with the one before, as homing needs it. Accepted hypotheses whose views are of two places become
    links without path images. A `known` map keeps its links and names. Places without a name are called after `rooms`,
    where poses are truth: what an owner would tell the robot.
    """

    min_path_matches: Annotated[int, Bounds(ge=0)] = 20
    """Features that a path image shares with the one before; 0: no path images, as in the paper, whose paths lead from
    medoid to medoid."""
    max_patches: Annotated[int, Bounds(ge=1)] = 80
    """Patches of a view that the map keeps."""
    max_segments: Annotated[int, Bounds(ge=0)] = 60
    """Vertical segments of a view that the map keeps."""
    spread: Literal["within_places", "all_views"] = "within_places"
    """Scale of visual distances in the sensor model: their root mean square from a place's views to its medoid, or the
    paper's "standard deviation of it, measured on the data" (section 5.3): of all views of the tour."""

    class Out(Outputs):
        map: TopologicalMap

    def step(
        self,
        ctx: Context,
        views: ComparedViews,
        hypotheses: LoopHypotheses,
        known: TopologicalMap | None = None,
        rooms: Rooms | None = None,
    ) -> Out:
        warn_of_few(ctx, len(views))
        place = hypotheses.place
        made = self._assembled(views, place, known)
        spread = spread_to_medoids(made, views, place) if self.spread == "within_places" else views.deviation()
        made = dataclasses.replace(
            made, spread=spread or place_clusters.rms_within(views.distances, hypotheses.subcluster)
        )
        made = with_loops(made, place[hypotheses.pairs[hypotheses.accepted]])
        if rooms is not None and views.pose_source == "truth":
            made = with_names(made, rooms)
        return self.Out(map=made)

    def _assembled(self, views: ComparedViews, place: Ints, known: TopologicalMap | None) -> TopologicalMap:
        options = views.comparison_options()
        patches = [each.patches() for each in views.features]
        kept = [self._kept(views, patches, view) for view in range(len(views))]
        kept_patches = [each.patches() for each in kept]

        def matches(view: int, other: int) -> int:
            return len(match_patches(patches[view], kept_patches[other], options).first)

        medoids = place_clusters.medoids(views.distances, place)
        ways = {} if known is None else known_ways(known, place)
        shared = matches if self.min_path_matches else None
        enough = self.min_path_matches
        for pair, way in driven_ways(views.distances, place, views.tours, medoids, shared, enough).items():
            if pair not in ways and pair[::-1] not in ways:
                between = np.empty(0, np.int64)
                if self.min_path_matches:
                    between = place_clusters.waypoint_views(matches, way, self.min_path_matches, MAX_PATH_STEP)
                ways[pair] = between, DRIVEN
        pairs = sorted(ways)
        images = [ways[pair][0] for pair in pairs]
        used = np.unique(np.concatenate([medoids, *images]))
        row = np.full(len(views), -1, np.int64)
        row[used] = np.arange(len(used))
        names = [""] * len(medoids)
        if known is not None:
            for view, owner in enumerate(known.owner):
                names[place[view]] = names[place[view]] or known.names[owner]
        return TopologicalMap(
            views=stored([kept[view] for view in used], [views.descriptors[view] for view in used]),
            places=row[medoids],
            owner=place[used],
            names=tuple(names),
            links=np.array(pairs, np.int64).reshape(-1, 2),
            kinds=np.array([ways[pair][1] for pair in pairs], np.int8),
            way_starts=np.cumsum([0, *(len(way) for way in images)], dtype=np.int64),
            ways=row[np.concatenate([np.empty(0, np.int64), *images])],
            frames=views.frames[used],
            orders=views.orders[used],
            poses=views.poses[used],
            pose_source=views.pose_source,
            spread=1.0,
        )

    def _kept(self, views: ComparedViews, patches: list[Patches], view: int) -> LocalFeatures:
        """The patches that were found again in most of the views around, of equals the strongest; the heavy columns."""
        whole = views.features[view]
        if whole.columns is not None:
            whole = dataclasses.replace(whole, columns=whole.columns.chosen(slice(0, self.max_segments)))
        if len(whole) <= self.max_patches:
            return whole
        seen, options = np.zeros(len(whole)), views.comparison_options()
        for other in range(max(0, view - WINDOW), min(len(views), view + WINDOW + 1)):
            if other != view and views.tours[other] == views.tours[view]:
                seen[match_patches(patches[view], patches[other], options).first] += 1.0
        return whole.chosen(np.sort(np.argsort(-seen, kind="stable")[: self.max_patches]))


def spread_to_medoids(map: TopologicalMap, views: ComparedViews, place: Ints) -> float:
    """Root mean square distance of views to the medoid of their place, as the map keeps it; 0 where there are none.

    That is what a robot measures in the right place: fewer features are kept of a medoid than a view has.
    """
    options, distances = views.comparison_options(), []
    for number, view in enumerate(map.places):
        kept = view_features(map.views.features(int(view)))
        for row in np.flatnonzero(place == number).tolist():
            if views.frames[row] != map.frames[view]:
                distances.append(compare(kept, views.view_features(row), options).distance)
    finite = np.array([distance for distance in distances if math.isfinite(distance)])
    return math.sqrt(float(np.mean(finite**2))) if len(finite) else 0.0


def driven_ways(
    distances: Array,
    place: Ints,
    tour: Ints,
    medoids: Ints,
    matches: Callable[[int, int], int] | None = None,
    min_matches: int = 0,
) -> dict[tuple[int, int], Ints]:
    """For each two places that were driven through one after the other: the views from one medoid to the other.

    Of several passes the one that comes nearest to both medoids. Where a medoid is of another pass, the way starts (or
    ends) with the medoid and with the view of this pass that looks most like it, of those that share `min_matches` with
    it; where none does, with the one that shares most. Few matches ahead and behind agree over metres in a corridor.
    """

    def nearest(medoid: int, run: Ints) -> int:
        order = run[np.argsort(distances[medoid, run], kind="stable")]
        if matches is None:
            return int(order[0])
        shared: list[int] = []
        for view in order.tolist():
            shared.append(min(matches(medoid, view), matches(view, medoid)))
            if shared[-1] >= min_matches:
                return int(view)
        return int(order[np.argmax(shared)])

    best: dict[tuple[int, int], tuple[float, int, Ints]] = {}
    runs = np.flatnonzero((np.diff(place) != 0) | (np.diff(tour) != 0)) + 1
    starts, ends = np.append(0, runs), np.append(runs, len(place))
    for before in range(len(starts) - 1):
        one, other = int(place[starts[before]]), int(place[starts[before + 1]])
        if tour[starts[before]] != tour[starts[before + 1]] or tour[starts[before]] == 0 or one == other:
            continue
        leave = np.arange(starts[before], ends[before])
        reach = np.arange(starts[before + 1], ends[before + 1])
        out, into = nearest(int(medoids[one]), leave), nearest(int(medoids[other]), reach)
        cost = float(distances[medoids[one], out] + distances[into, medoids[other]])
        way = np.arange(out, into + 1)
        if out != medoids[one]:
            way = np.append(medoids[one], way)
        if into != medoids[other]:
            way = np.append(way, medoids[other])
        pair = (one, other)
        back = (other, one)
        if back in best:
            pair, way = back, way[::-1]
        if pair not in best or (cost, len(way)) < best[pair][:2]:
            best[pair] = (cost, len(way), way)
    return {pair: way for pair, (_, _, way) in best.items()}


def known_ways(known: TopologicalMap, place: Ints) -> dict[tuple[int, int], tuple[Ints, int]]:
    """A known map's ways between what its places have become, and their kinds. Its views are the first of all."""
    ways: dict[tuple[int, int], tuple[Ints, int]] = {}
    for link, (one, other) in enumerate(known.links):
        pair = int(place[known.places[one]]), int(place[known.places[other]])
        if pair[0] != pair[1] and pair not in ways and pair[::-1] not in ways:
            ways[pair] = known.path_of(link), int(known.kinds[link])
    return ways


def with_names(map: TopologicalMap, rooms: Rooms) -> TopologicalMap:
    """The map with unnamed places called after the room in which their medoid was taken."""
    at = [rooms.at(float(x), float(y)) for x, y, _ in map.poses[map.places]]
    names = tuple(own or room for own, room in zip(map.names, at, strict=True))
    return dataclasses.replace(map, names=names)


def with_loops(map: TopologicalMap, pairs: Ints) -> TopologicalMap:
    """The map with links between pairs of places (L, 2) that look similar, without path images."""
    ordered = dict.fromkeys((int(pair.min()), int(pair.max())) for pair in pairs)
    new = [pair for pair in ordered if pair[0] != pair[1] and map.link(*pair) is None]
    return dataclasses.replace(
        map,
        links=np.concatenate([map.links, np.array(new, np.int64).reshape(-1, 2)]),
        kinds=np.append(map.kinds, np.full(len(new), LOOP, np.int8)),
        way_starts=np.append(map.way_starts, np.full(len(new), map.way_starts[-1])),
    )

"""Makes a topological map of a tour, once all its pictures are known."""

import dataclasses
import math
from collections.abc import Sequence
from typing import Annotated, Literal, NamedTuple

import numpy as np
import numpy.typing as npt

from omninav.pipeline import Bounds, Context, Outputs, Stage, Tick
from omninav.pipeline.graph.problems import BadInput
from omninav.stages.geometry.appearance import place_clusters
from omninav.stages.geometry.appearance.visual_distance import (
    Matching,
    Measure,
    Ready,
    colours_apart,
    compare,
    made_ready,
    match_patches,
)
from omninav.stages.geometry.probability import dempster_shafer
from omninav.stages.values.drive import pose_row
from omninav.stages.values.local_features import GlobalDescriptor, LocalFeatures, VerticalSegments
from omninav.stages.values.pose import Pose, PoseSource
from omninav.stages.values.rooms import Rooms
from omninav.stages.values.topological_map import DRIVEN, LOOP, LoopHypotheses, TopologicalMap, stored

from .pose_of_view import Supervised

Array = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]
Bools = npt.NDArray[np.bool_]


class View(NamedTuple):
    """A picture of a tour, or one that a known map keeps (`owner`: its place there).

    `frame`: its number among all pictures; `order`: among those that take part, with a gap from tour to tour.
    """

    features: LocalFeatures
    columns: VerticalSegments | None
    moments: GlobalDescriptor
    pose: tuple[float, float, float]
    frame: int
    order: int
    tour: int
    owner: int = -1


class Kept(NamedTuple):
    """What a map keeps of a view."""

    features: LocalFeatures
    columns: VerticalSegments


class AllCompared(NamedTuple):
    """Every two of N views compared, each (N, N): visual `distances`, and the `shares` of features that match."""

    distances: Array
    shares: Array


def compare_all(
    ctx: Context,
    views: Sequence[Ready],
    known: int,
    moments: Array,
    colour: float,
    matching: Matching,
    measure: Measure,
) -> AllCompared:
    """Combined visual distances of views: inf where their colours lie further apart than `colour`.

    Goedeme et al. 2007, section 4.2.3: local features are only compared where global ones leave it open. The first
    `known` of them are what a map keeps of its views.
    """
    number = len(views)
    distances = np.full((number, number), math.inf)
    shares = np.zeros((number, number))
    near = colours_apart(moments[:, None], moments[None]) <= colour
    for one in range(number):
        ctx.progress(one, number)
        distances[one, one], shares[one, one] = 0.0, 1.0
        for other in range(one + 1, number):
            if near[one, other]:
                found = compare(views[one], views[other], matching, measure, part=one < known <= other)
                distances[one, other] = distances[other, one] = found.distance
                shares[one, other] = shares[other, one] = found.matches / max(found.of, 1.0)
    return AllCompared(distances, shares)


class TopologicalMapping(Stage):
    """Places and ways of a tour from its pictures alone: clusters, loop hypotheses, Dempster-Shafer evidence.

    Goedeme et al. 2007, section 4. Pictures closer together than `every_s` seconds are passed over. Views whose visual
    distance (equations 3 and 4, erratum 27) is at most `place_size` all among each other make a cluster; its parts
    along the drive are subclusters, each two of one cluster a hypothesis: they are one place. It starts with the visual
    similarity (`similarity`, erratum 28; scaled by the root mean square distance within subclusters) of the two views
    that stand for them, and an `ignorance`; neighbours within `reach` pictures of the drive, of those that take part,
    add evidence in one pass (erratum 31). It is accepted where its support exceeds `support` and some neighbour has
    spoken: of an isolated one nothing can be decided (section 4.4.3). Its subclusters become one place; with
    `accepted: link` they stay two, joined by a link.

    The views that stand for two subclusters are those that look most alike; `between: medoids` takes the paper's
    prototypes, which lie apart where a drive returns between its pictures. Where less than `least_share` of the
    features match they do not look alike: a wall that repeats itself matches exactly, so that its angles say nothing,
    but only on one side of the robot.

    Of each view the `patches` are kept that were found again in most of the pictures around it, and the `columns`
    heaviest. On the way from place to place path images are kept: at least `path_matches` of what is kept of each is
    seen from the one before, as homing needs it, and they are at most `path_pictures` pictures of the drive apart. A
    map grows where `known` is wired: its views take part by what is kept of them, its places stay together. Places are
    called after `rooms`, where these are wired and poses are truth: what an owner would tell the robot. Poses are kept
    for scoring and drawing only: the tour's truth, without it (`supervised: auto`) its odometry. Raises BadInput where
    `supervised: truth` finds none, where no picture shows anything, or where known and new poses are not of one source.
    """

    every_s: Annotated[float, Bounds(ge=0)] = 1.0
    place_size: Annotated[float, Bounds(gt=0)] = 0.5
    path_matches: Annotated[int, Bounds(ge=1)] = 20
    path_pictures: Annotated[int, Bounds(ge=1)] = 5
    colour: Annotated[float, Bounds(gt=0)] = 0.5
    ratio: Annotated[float, Bounds(gt=0, le=1)] = 0.8
    column_ratio: Annotated[float, Bounds(gt=0, le=1)] = 0.8
    patch_colour: Annotated[float, Bounds(gt=0)] = 0.5
    least_matches: Annotated[int, Bounds(ge=2)] = 8
    least_angle_deg: Annotated[float, Bounds(ge=0)] = 0.5
    skipped: Annotated[int, Bounds(ge=0)] = 0
    between: Literal["nearest", "medoids"] = "nearest"
    least_share: Annotated[float, Bounds(ge=0, le=1)] = 0.4
    similarity: Literal["ratio", "exponential", "gaussian"] = "gaussian"
    ignorance: Annotated[float, Bounds(ge=0.01, le=1)] = 0.25
    reach: Annotated[float, Bounds(gt=0)] = 20.0
    support: Annotated[float, Bounds(ge=0, le=1)] = 0.5
    accepted: Literal["merge", "link"] = "merge"
    patches: Annotated[int, Bounds(ge=1)] = 80
    columns: Annotated[int, Bounds(ge=0)] = 60
    around: Annotated[int, Bounds(ge=1)] = 3
    supervised: Supervised = "auto"

    class Out(Outputs):
        """The map, and what became of each hypothesis."""

        map: TopologicalMap
        hypotheses: LoopHypotheses

    def step(
        self,
        ctx: Context,
        ticks: Sequence[Tick],
        features: Sequence[LocalFeatures | None],
        descriptor: Sequence[GlobalDescriptor | None],
        vertical_segments: Sequence[VerticalSegments | None] = (),
        odometry: Sequence[Pose | None] = (),
        truth: Sequence[Pose | None] = (),
        known: TopologicalMap | None = None,
        rooms: Rooms | None = None,
    ) -> Out:
        """The whole tour at once."""
        source = self._pose_source(ctx, truth, known)
        kept = self._kept(ticks, features, descriptor)
        poses = truth if source == "truth" else odometry
        views = self._views(known)
        first = 1 + max((view.frame for view in views), default=-1)
        order = max((view.order for view in views), default=-1)
        for place, row in enumerate(kept):
            fresh = place == 0 or ticks[kept[place - 1]].log != ticks[row].log
            order += math.ceil(self.reach) + 1 if fresh else 1  # tours do not follow each other on the floor
            at = pose_row(poses[row] if row < len(poses) else None)
            seen, whole = features[row], descriptor[row]
            assert seen is not None
            assert whole is not None
            beside = vertical_segments[row] if row < len(vertical_segments) else None
            views.append(View(seen, beside, whole, at, first + row, order, 1 + ticks[row].log))
        if not views:
            raise BadInput("mapping: no picture of the tour shows anything; use another tour")
        ctx.doing(f"comparing {len(views)} views")
        matching = Matching(self.ratio, self.column_ratio, self.patch_colour)
        measure = Measure(self.least_matches, math.radians(self.least_angle_deg))
        colours = np.stack([view.moments.values for view in views]).astype(np.float64)
        ready = [made_ready(view.features, view.columns) for view in views]
        old = sum(view.owner >= 0 for view in views)
        compared = compare_all(ctx, ready, old, colours, self.colour, matching, measure)
        out = self._map_of(views, compared, source, known, matching, measure)
        return out if rooms is None or source != "truth" else dataclasses.replace(out, map=with_names(out.map, rooms))

    def _kept(
        self,
        ticks: Sequence[Tick],
        features: Sequence[LocalFeatures | None],
        moments: Sequence[GlobalDescriptor | None],
    ) -> list[int]:
        """The pictures that take part: no two of a tour closer together than `every_s`, a tenth of it forgiven."""
        kept: list[int] = []
        for row, tick in enumerate(ticks):
            if features[row] is None or moments[row] is None:
                continue
            last = ticks[kept[-1]] if kept else None
            if last is None or last.log != tick.log or tick.stamp - last.stamp >= 0.9e9 * self.every_s:
                kept.append(row)
        return kept

    def _pose_source(self, ctx: Context, truth: Sequence[Pose | None], known: TopologicalMap | None) -> PoseSource:
        there = any(pose is not None for pose in truth)
        if self.supervised == "truth" and not there:
            raise BadInput(
                "mapping: the tour has no ground truth; use a tour with /ground_truth/pose, or "
                "nodes.mapping.supervised=auto"
            )
        source: PoseSource = "truth" if there and self.supervised != "odometry" else "odometry"
        if known is not None and len(known) and known.pose_source != source:
            raise BadInput(
                f"mapping: the known map's poses are from {known.pose_source}, the tour's from {source}: they have "
                "no frame in common; use a tour with the same, or nodes.mapping.supervised=truth"
            )
        ctx.fact("map_poses", source)
        return source

    def _views(self, known: TopologicalMap | None) -> list[View]:
        if known is None:
            return []
        kept = []
        for view in range(len(known.views)):
            beside = known.views.columns(view)
            x, y, heading = (float(number) for number in known.poses[view])
            kept.append(
                View(
                    known.views.features(view),
                    beside if len(beside) else None,
                    known.views.global_moments(view),
                    (x, y, heading),
                    int(known.frames[view]),
                    int(known.orders[view]),
                    0,
                    int(known.owner[view]),
                )
            )
        return kept

    def _map_of(
        self,
        views: list[View],
        compared: AllCompared,
        source: PoseSource,
        known: TopologicalMap | None,
        matching: Matching,
        measure: Measure,
    ) -> Out:
        distances = compared.distances
        tour, owner = np.array([view.tour for view in views]), np.array([view.owner for view in views])
        orders = np.array([view.order for view in views])
        poses = np.array([view.pose for view in views])
        cluster = place_clusters.complete_linkage(distances, self.place_size)
        part = self._parts(cluster, tour, owner)
        number = int(part.max()) + 1
        medoids = np.array([place_clusters.medoid(distances, np.flatnonzero(part == p)) for p in range(number)])
        found = place_clusters.hypotheses(cluster, part, medoids)
        old = owner[medoids]
        settled = (old[found.pairs] >= 0).all(axis=1)  # between two places of a known map nothing is asked again
        found = place_clusters.Hypotheses(found.pairs[~settled], found.medoids[~settled])
        spread = within_parts(distances, part)
        if self.between == "nearest":
            found = place_clusters.Hypotheses(found.pairs, nearest_views(distances, part, found.pairs))
        apart = distances[found.medoids[:, 0], found.medoids[:, 1]]
        enough = compared.shares[found.medoids[:, 0], found.medoids[:, 1]] >= self.least_share
        alike = dempster_shafer.similarity_of(np.where(enough, apart, math.inf), spread, self.similarity)
        initial = dempster_shafer.masses(alike, 1.0 - self.ignorance)
        told = dempster_shafer.gather(initial, place_clusters.between_hypotheses(found.medoids, orders), self.reach)
        heard = dempster_shafer.unknown(told) < dempster_shafer.unknown(initial)
        accepted = (dempster_shafer.support(told) > self.support) & heard
        same = [np.column_stack([np.flatnonzero(old == place)[:-1], np.flatnonzero(old == place)[1:]]) for place in
                range(int(old.max(initial=-1)) + 1)]  # fmt: skip
        joined = found.pairs[accepted] if self.accepted == "merge" else found.pairs[:0]
        place_of_part = place_clusters.groups(number, np.concatenate([joined, *same]))
        place = place_clusters.renumbered(place_of_part[part])
        few = [self._few(views, view, matching) for view in range(len(views))]
        made = self._assembled(views, few, distances, place, tour, source, known, matching, spread)
        made = dataclasses.replace(made, spread=spread_to_medoids(made, views, place, matching, measure) or spread)
        if self.accepted == "link":
            made = with_loops(made, place[found.medoids[accepted]])
        return self.Out(
            map=made,
            hypotheses=LoopHypotheses(
                poses, cluster, part, place, tour, found.medoids, apart, initial, told, accepted, source
            ),
        )

    def _parts(self, cluster: Ints, tour: Ints, owner: Ints) -> Ints:
        """Subclusters; of a known map's views those of one place and one cluster."""
        parts = place_clusters.subclusters(cluster, tour, self.skipped)
        old = owner >= 0
        labels = np.where(old, len(cluster) + owner * (int(cluster.max()) + 1) + cluster, parts)
        return place_clusters.renumbered(labels)

    def _assembled(
        self,
        views: list[View],
        few: list[Kept],
        distances: Array,
        place: Ints,
        tour: Ints,
        source: PoseSource,
        known: TopologicalMap | None,
        matching: Matching,
        spread: float,
    ) -> TopologicalMap:
        def seen_from(view: int, other: int) -> int:
            return len(match_patches(views[view].features, few[other].features, matching).first)

        number = int(place.max()) + 1
        medoids = np.array([place_clusters.medoid(distances, np.flatnonzero(place == p)) for p in range(number)])
        ways = {} if known is None else old_ways(known, place)
        for pair, way in driven_ways(distances, place, tour, medoids).items():
            if pair not in ways and pair[::-1] not in ways:
                ways[pair] = (
                    place_clusters.path_images(seen_from, way, self.path_matches, self.path_pictures),
                    DRIVEN,
                )
        pairs = sorted(ways)
        images = [ways[pair][0] for pair in pairs]
        used = np.unique(np.concatenate([medoids, *images]))
        row = np.full(len(views), -1, np.int64)
        row[used] = np.arange(len(used))
        names = [""] * number
        if known is not None:
            for view, own in enumerate(known.owner):
                names[place[view]] = names[place[view]] or known.names[own]
        return TopologicalMap(
            views=stored(
                [few[view].features for view in used],
                [few[view].columns for view in used],
                [views[view].moments for view in used],
            ),
            places=row[medoids],
            owner=place[used],
            names=tuple(names),
            links=np.array(pairs, np.int64).reshape(-1, 2),
            kinds=np.array([ways[pair][1] for pair in pairs], np.int8),
            way_starts=np.cumsum([0, *(len(way) for way in images)], dtype=np.int64),
            ways=row[np.concatenate([np.empty(0, np.int64), *images])],
            frames=np.array([views[view].frame for view in used], np.int64),
            orders=np.array([views[view].order for view in used], np.int64),
            poses=np.array([views[view].pose for view in used]),
            pose_source=source,
            spread=spread,
        )

    def _few(self, views: list[View], view: int, matching: Matching) -> Kept:
        """The patches that were found again in most of the pictures around; of equals the strongest."""
        whole = views[view]
        columns = no_columns() if whole.columns is None else whole.columns.chosen(slice(0, self.columns))
        if len(whole.features) <= self.patches:
            return Kept(whole.features, columns)
        seen = np.zeros(len(whole.features))
        for other in range(max(0, view - self.around), min(len(views), view + self.around + 1)):
            if other != view and views[other].tour == whole.tour:
                seen[match_patches(whole.features, views[other].features, matching).first] += 1.0
        return Kept(whole.features.chosen(np.sort(np.argsort(-seen, kind="stable")[: self.patches])), columns)


def no_columns() -> VerticalSegments:
    """No column segments."""
    nothing = np.empty(0, np.float32)
    return VerticalSegments(np.empty(0), np.empty((0, 2)), np.empty((0, 10), np.float32), nothing, np.empty((0, 2, 2)))


def nearest_views(distances: Array, part: Ints, pairs: Ints) -> Ints:
    """Of each two subclusters (H, 2) the two views, one of each, that are least far apart: (H, 2)."""
    members = [np.flatnonzero(part == number) for number in range(int(part.max()) + 1)]
    nearest = np.empty((len(pairs), 2), np.int64)
    for row, (one, other) in enumerate(pairs):
        between = distances[np.ix_(members[one], members[other])]
        first, second = np.unravel_index(int(between.argmin()), between.shape)
        nearest[row] = members[one][first], members[other][second]
    return nearest


def within_parts(distances: Array, part: Ints) -> float:
    """Root mean square of the visual distances within parts; without any, 1."""
    same = np.triu(part[:, None] == part[None], 1)
    inside = distances[same]
    inside = inside[np.isfinite(inside)]
    spread = math.sqrt(float(np.mean(inside**2))) if len(inside) else 0.0
    return spread if spread > 0.0 else 1.0


def spread_to_medoids(
    map: TopologicalMap, views: Sequence[View], place: Ints, matching: Matching, measure: Measure
) -> float:
    """Root mean square distance of views to the medoid of their place, as the map keeps it; 0 where there are none.

    That is what a robot measures in the right place: fewer features are kept of a medoid than a view has.
    """
    apart = []
    for number, view in enumerate(map.places):
        beside = map.views.columns(int(view))
        kept = made_ready(map.views.features(int(view)), beside if len(beside) else None)
        for row in np.flatnonzero(place == number).tolist():
            if views[row].frame != map.frames[view]:
                here = made_ready(views[row].features, views[row].columns)
                apart.append(compare(kept, here, matching, measure).distance)
    known = np.array([distance for distance in apart if math.isfinite(distance)])
    return math.sqrt(float(np.mean(known**2))) if len(known) else 0.0


def driven_ways(distances: Array, place: Ints, tour: Ints, medoids: Ints) -> dict[tuple[int, int], Ints]:
    """For each two places that were driven through one after the other: the views from one medoid to the other.

    Of several passes the one that comes nearest to both medoids. Where a medoid is of another pass, the way starts (or
    ends) with the view of this pass that looks most like it, and with the medoid before (or after) it.
    """
    best: dict[tuple[int, int], tuple[float, int, Ints]] = {}
    runs = np.flatnonzero((np.diff(place) != 0) | (np.diff(tour) != 0)) + 1
    starts, ends = np.append(0, runs), np.append(runs, len(place))
    for before in range(len(starts) - 1):
        one, other = int(place[starts[before]]), int(place[starts[before + 1]])
        if tour[starts[before]] != tour[starts[before + 1]] or tour[starts[before]] == 0 or one == other:
            continue
        leave = np.arange(starts[before], ends[before])
        reach = np.arange(starts[before + 1], ends[before + 1])
        out = leave[np.argmin(distances[medoids[one], leave])]
        into = reach[np.argmin(distances[medoids[other], reach])]
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


def old_ways(known: TopologicalMap, place: Ints) -> dict[tuple[int, int], tuple[Ints, int]]:
    """A known map's ways between what its places have become, and their kinds. Its views are the first of all."""
    ways: dict[tuple[int, int], tuple[Ints, int]] = {}
    for link, (one, other) in enumerate(known.links):
        pair = int(place[known.places[one]]), int(place[known.places[other]])
        if pair[0] != pair[1] and pair not in ways and pair[::-1] not in ways:
            ways[pair] = known.way(link), int(known.kinds[link])
    return ways


def with_names(map: TopologicalMap, rooms: Rooms) -> TopologicalMap:
    """The map with places called after the room that their medoid was taken in, where they have no name yet."""
    at = [rooms.at(float(x), float(y)) for x, y, _ in map.poses[map.places]]
    names = tuple(own or room for own, room in zip(map.names, at, strict=True))
    return dataclasses.replace(map, names=names)


def with_loops(map: TopologicalMap, pairs: Ints) -> TopologicalMap:
    """The map with links between places that were found to be one, without path images: they look alike."""
    new = [pair for pair in dict.fromkeys(map_pair(pair) for pair in pairs) if map.link(*pair) is None]
    number = len(new)
    return dataclasses.replace(
        map,
        links=np.concatenate([map.links, np.array(new, np.int64).reshape(-1, 2)]),
        kinds=np.append(map.kinds, np.full(number, LOOP, np.int8)),
        way_starts=np.append(map.way_starts, np.full(number, map.way_starts[-1])),
    )


def map_pair(pair: Ints) -> tuple[int, int]:
    """Two places, the lower first."""
    return int(pair.min()), int(pair.max())

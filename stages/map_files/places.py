"""Topological maps, joined, thinned and cut."""

import dataclasses
import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from omninav.pipeline import BadInput
from omninav.stages.geometry.arrays import Bools, Ints
from omninav.stages.geometry.runs import chosen_runs
from omninav.stages.values.pose import PoseSource
from omninav.stages.values.topological_map import StoredViews, TopologicalMap


def joined_places(maps: Sequence[TopologicalMap], pose_source: PoseSource) -> TopologicalMap:
    """One map of the places and links of several, in their order; no link leads from one map to another.

    `frames` and `orders` are counted on from map to map. Raises BadInput where descriptors are of different lengths.
    """
    widths = {map.views.descriptors.shape[1] for map in maps if len(map)}
    if len(widths) > 1:
        raise BadInput(
            f"maps: their descriptors have {' and '.join(map(str, sorted(widths)))} numbers, expected one length"
        )
    maps = [map for map in maps if len(map)] or list(maps[:1])
    views, places = (np.cumsum([0, *(len(part) for part in parts)]) for parts in ([m.views for m in maps], maps))
    ways = np.cumsum([0, *(len(map.ways) for map in maps)])
    numbered = list(zip(maps, views, places, ways, strict=False))
    weights = [len(map.views) for map in maps]
    return TopologicalMap(
        views=_joined_views([map.views for map in maps]),
        places=np.concatenate([map.places + view for map, view, _, _ in numbered]),
        owner=np.concatenate([map.owner + place for map, _, place, _ in numbered]),
        names=tuple(name for map in maps for name in map.names),
        links=np.concatenate([map.links + place for map, _, place, _ in numbered]),
        kinds=np.concatenate([map.kinds for map in maps]),
        way_starts=np.concatenate([[0], *(map.way_starts[1:] + way for map, _, _, way in numbered)]).astype(np.int64),
        ways=np.concatenate([map.ways + view for map, view, _, _ in numbered]),
        frames=_counted_on([map.frames for map in maps], 1),
        orders=_counted_on([map.orders for map in maps], 2),
        poses=np.concatenate([map.poses for map in maps]),
        pose_source=pose_source,
        spread=math.sqrt(float(np.average([map.spread**2 for map in maps], weights=weights if any(weights) else None))),
    )


def thinned_places(map: TopologicalMap, spacing_m: float) -> TopologicalMap:
    """The map with path images that are at least `spacing_m` apart along their way; all places stay."""
    ways = []
    for link, (place, _) in enumerate(map.links):
        last, kept = map.poses[map.places[place], :2], []
        for view in map.path_of(link).tolist():
            if math.dist(map.poses[view, :2], last) >= spacing_m:
                last = map.poses[view, :2]
                kept.append(view)
        ways.append(np.array(kept, np.int64))
    return _chosen(map, np.ones(len(map), bool), np.arange(len(map.links)), ways)


def cut_places(map: TopologicalMap, inside: Bools) -> TopologicalMap:
    """The places of a mask (P,), and the links between them with all their path images."""
    links = np.flatnonzero(inside[map.links].all(axis=1))
    return _chosen(map, inside, links, [map.path_of(link) for link in links.tolist()])


def _chosen(map: TopologicalMap, places: Bools, links: Ints, ways: Sequence[Ints]) -> TopologicalMap:
    """The places of a mask and some links, each with its path images; strays go to the link's first place."""
    used = np.unique(np.concatenate([map.places[places], *ways]))
    place, owner = np.cumsum(places) - 1, map.owner.copy()
    for link, way in zip(links.tolist(), ways, strict=True):
        strays = way[~places[owner[way]]]
        owner[strays] = map.links[link, 0]
    return dataclasses.replace(
        map,
        views=_chosen_views(map.views, used),
        places=np.searchsorted(used, map.places[places]),
        owner=place[owner[used]],
        names=tuple(name for name, kept in zip(map.names, places.tolist(), strict=True) if kept),
        links=place[map.links[links]],
        kinds=map.kinds[links],
        way_starts=np.cumsum([0, *(len(way) for way in ways)], dtype=np.int64),
        ways=np.searchsorted(used, np.concatenate([np.empty(0, np.int64), *ways])),
        frames=map.frames[used],
        orders=map.orders[used],
        poses=map.poses[used],
    )


def _chosen_views(views: StoredViews, used: Ints) -> StoredViews:
    patches, starts = chosen_runs(views.starts, used)
    columns, column_starts = chosen_runs(views.column_starts, used)
    return StoredViews(
        starts=starts,
        directions=views.directions[patches],
        descriptors=views.descriptors[patches],
        colours=views.colours[patches],
        sizes=views.sizes[patches],
        column_starts=column_starts,
        column_directions=views.column_directions[columns],
        column_descriptors=views.column_descriptors[columns],
        column_weights=views.column_weights[columns],
        moments=views.moments[used],
    )


def _joined_views(views: Sequence[StoredViews]) -> StoredViews:
    def whole(name: str) -> Any:
        return np.concatenate([getattr(each, name) for each in views])

    fields = {field.name: whole(field.name) for field in dataclasses.fields(StoredViews)}
    for name in ("starts", "column_starts"):
        sizes = [np.diff(getattr(each, name)) for each in views]
        fields[name] = np.cumsum(np.concatenate([[0], *sizes]), dtype=np.int64)
    return StoredViews(**fields)


def _counted_on(numbers: Sequence[Ints], gap: int) -> Ints:
    shift, found = 0, []
    for own in numbers:
        found.append(own + shift)
        shift += int(own.max(initial=-gap)) + gap
    return np.concatenate(found)

"""Topological maps, joined, thinned and cut."""

import dataclasses
import math

import made_places
import numpy as np
import pytest

from omninav.pipeline import BadInput
from omninav.pipeline.graph.contents import violation
from omninav.stages.map_files.places import cut_places, joined_places, thinned_places
from omninav.stages.values.topological_map import TopologicalMap


def corner() -> TopologicalMap:
    """Three places, two driven links with path images on the way, and a loop."""
    map = made_places.made_map([(0, 0), (2, 0), (2, 2)], {(0, 1): 3, (1, 2): 3}, [(0, 2)], ["a", "", "b"])
    poses = map.poses.copy()
    for link, (one, other) in enumerate(map.links[:2].tolist()):
        share = np.arange(1, 4)[:, None] / 4
        poses[map.path_of(link), :2] = poses[one, :2] * (1 - share) + poses[other, :2] * share
    return dataclasses.replace(map, poses=poses)


def same_view(one: TopologicalMap, view: int, other: TopologicalMap, again: int) -> bool:
    return np.array_equal(one.views.features(view).descriptors, other.views.features(again).descriptors)


def test_joined_places_keep_their_links_and_views() -> None:
    map = corner()
    both = joined_places([map, map], "truth")
    assert violation(both) is None
    assert len(both) == 6
    assert both.names == ("a", "", "b", "a", "", "b")
    assert both.links.tolist() == [*map.links.tolist(), *(map.links + 3).tolist()]
    for link in range(3):
        assert (both.path_of(link + 3) == map.path_of(link) + len(map.views)).all()
    assert all(same_view(both, view + len(map.views), map, view) for view in range(len(map.views)))
    assert joined_places([map, dataclasses.replace(map, spread=2.0)], "truth").spread == math.sqrt((1 + 4) / 2)
    assert both.frames[len(map.views)] == map.frames.max() + 1
    assert both.orders[len(map.views)] == map.orders.max() + 2  # they are not neighbours
    assert len(joined_places([map, cut_places(map, np.array([False, True, True]))], "truth")) == 5
    short = dataclasses.replace(map.views, descriptors=map.views.descriptors[:, :64].copy())
    with pytest.raises(BadInput, match="their descriptors have 64 and 128 numbers, expected one length"):
        joined_places([map, dataclasses.replace(map, views=short)], "truth")
    none = cut_places(map, np.zeros(3, bool))
    assert [len(joined_places([none, *more], "truth").views) for more in ([], [none], [map])] == [0, 0, 9]


def test_thinned_ways_keep_images_that_are_apart_and_all_places() -> None:
    map = corner()
    thin = thinned_places(map, 0.9)
    assert violation(thin) is None
    assert len(thin) == 3
    assert [len(thin.path_of(link)) for link in range(3)] == [1, 1, 0]
    assert np.allclose(thin.poses[thin.path_of(1)[0], :2], (2.0, 1.0))
    assert same_view(thin, int(thin.path_of(1)[0]), map, int(map.path_of(1)[1]))


def test_a_cut_map_keeps_the_links_inside_with_their_images() -> None:
    map = corner()
    cut = cut_places(map, np.array([False, True, True]))
    assert violation(cut) is None
    assert cut.links.tolist() == [[0, 1]]
    assert cut.names == ("", "b")
    assert len(cut.views) == 5
    assert same_view(cut, int(cut.path_of(0)[2]), map, int(map.path_of(1)[2]))
    assert violation(cut_places(map, np.zeros(3, bool))) is None


def test_an_image_whose_place_is_cut_away_goes_to_its_way() -> None:
    map = corner()
    owner = map.owner.copy()
    owner[map.path_of(1)] = 0
    cut = cut_places(dataclasses.replace(map, owner=owner), np.array([False, True, True]))
    assert cut.owner[cut.path_of(0)].tolist() == [0, 0, 0]

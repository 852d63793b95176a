"""Ways between places, names, loops and spread of small topological maps, worked by hand."""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from made_places import made_map
from made_views import between_looks, made_hypotheses, made_views
from made_words import features_of

from omninav.pipeline import Context
from omninav.stages.mapping.topological import (
    TopologicalMapping,
    driven_ways,
    known_ways,
    spread_to_medoids,
    with_loops,
    with_names,
)
from omninav.stages.values.compared_views import ComparedViews
from omninav.stages.values.local_features import LocalFeatures, VerticalSegments
from omninav.stages.values.rooms import Rooms
from omninav.stages.values.topological_map import DRIVEN, LOOP, TopologicalMap, stored

WINDOW = "omninav.stages.mapping.topological.WINDOW"


def ways(looks: list[float], place: list[int], medoids: list[int], tour: list[int] | None = None) -> dict:
    numbers = np.ones(len(place), np.int64) if tour is None else np.array(tour)
    found = driven_ways(between_looks(looks), np.array(place), numbers, np.array(medoids))
    return {pair: way.tolist() for pair, way in found.items()}


def test_a_way_leads_from_medoid_to_medoid_along_the_drive() -> None:
    assert ways([0, 1, 2, 10, 11, 12], [0, 0, 0, 1, 1, 1], [1, 4]) == {(0, 1): [1, 2, 3, 4]}


def test_where_a_medoid_is_of_another_pass_the_way_begins_and_ends_with_it() -> None:
    # A second pass (views 5 to 8) is the only one from 0 to 1; both medoids are of the first, by way of 2.
    looks, place = [0, 0.1, 50, 10, 50, 0.3, 0.2, 10.4, 10.2], [0, 0, 2, 1, 2, 0, 0, 1, 1]
    assert ways(looks, place, [1, 3, 2])[(0, 1)] == [1, 6, 7, 8, 3]


def test_a_way_enters_another_pass_where_it_shares_enough_matches_with_the_medoid() -> None:
    # As above; view 6 looks most like medoid 1, view 5 shares more with it, and neither 7 nor 8 shares enough with 3.
    looks, place = [0, 0.1, 50, 10, 50, 0.3, 0.2, 10.4, 10.2], [0, 0, 2, 1, 2, 0, 0, 1, 1]
    shared = {(1, 5): 30, (5, 1): 20, (1, 6): 40, (6, 1): 19, (3, 7): 12, (7, 3): 13, (3, 8): 11, (8, 3): 99}
    distances, tour, medoids = between_looks(looks), np.ones(9, np.int64), np.array([1, 3, 2])
    found = driven_ways(distances, np.array(place), tour, medoids, lambda *views: shared.get(views, 50), 20)
    assert found[(0, 1)].tolist() == [1, 5, 6, 7, 3]


def test_of_several_passes_the_one_counts_that_comes_nearest_to_both_medoids() -> None:
    # 0 to 1 is driven at 0.5 and 10.5, then (from elsewhere) at 0 and 10, the medoids, and back again at 10.1 and 0.1.
    looks, place = [0.5, 10.5, 50, 0.0, 10.0, 50, 10.1, 0.1], [0, 1, 2, 0, 1, 2, 1, 0]
    assert ways(looks, place, [3, 4, 2])[(0, 1)] == [3, 4]
    assert ways(looks, place, [7, 6, 2])[(0, 1)] == [7, 6]  # as it was driven back, turned round


def test_of_passes_that_are_as_near_the_shortest_counts() -> None:
    looks, place = [0.0, 0.1, 10.0, 50, 0.0, 10.0], [0, 0, 1, 2, 0, 1]
    found = ways(looks, place, [0, 2, 3])
    assert found[(0, 1)] in ([0, 1, 2], [0, 4, 5, 2])
    assert len(found[(0, 1)]) == 3
    later = ways([0.0, 10.0, 50, 0.0, 0.1, 10.0], [0, 1, 2, 0, 0, 1], [0, 1, 2])
    assert later[(0, 1)] == [0, 1]


def test_places_are_joined_in_the_order_in_which_they_were_first_driven() -> None:
    assert set(ways([0, 10, 0, 20], [0, 1, 0, 2], [0, 1, 3])) == {(0, 1), (0, 2)}
    assert set(ways([10, 0, 10], [1, 0, 1], [1, 0])) == {(1, 0)}


def test_no_way_leads_from_tour_to_tour_nor_within_a_known_map() -> None:
    looks, place = [0.0, 10, 20, 30, 40, 50], [0, 1, 2, 3, 4, 5]
    found = ways(looks, place, [0, 1, 2, 3, 4, 5], [0, 0, 1, 1, 2, 2])
    assert set(found) == {(2, 3), (4, 5)}
    assert ways([0.0, 0.1, 0.2], [0, 0, 0], [1], [1, 1, 2]) == {}  # one place, left with a tour


def test_known_ways_are_kept_between_what_their_places_have_become() -> None:
    known = made_map([(0, 0), (1, 0), (2, 0), (3, 0)], {(0, 1): 2, (1, 2): 1, (2, 3): 0}, [(0, 3)])
    # Its views are 4 medoids and 3 path images. Places 2 and 3 have become one, so that (0, 3) is (0, 2) now.
    place = np.array([5, 1, 2, 2, 5, 5, 1])
    found = known_ways(known, place)
    assert {pair: (way.tolist(), kind) for pair, (way, kind) in found.items()} == {
        (5, 1): ([4, 5], DRIVEN),
        (1, 2): ([6], DRIVEN),
        (5, 2): ([], LOOP),
    }
    # Places 0 and 2 have become one: the way back from there to 1 is one way with that to it.
    assert set(known_ways(known, np.array([0, 1, 0, 3, 0, 0, 1]))) == {(0, 1), (0, 3)}


def test_links_of_loops_are_new_ones_each_once_and_none_to_itself() -> None:
    map = made_map([(0, 0), (1, 0), (2, 0), (3, 0)], {(0, 1): 2, (1, 2): 0})
    pairs = np.array([[1, 0], [3, 1], [1, 3], [2, 2], [0, 2]])
    found = with_loops(map, pairs)
    assert found.links.tolist() == [[0, 1], [1, 2], [1, 3], [0, 2]]
    assert found.kinds.tolist() == [DRIVEN, DRIVEN, LOOP, LOOP]
    assert [found.path_of(link).tolist() for link in range(4)] == [[4, 5], [], [], []]
    assert with_loops(map, np.empty((0, 2), np.int64)).links.tolist() == map.links.tolist()


def test_a_place_is_called_after_the_smallest_room_that_it_is_in_unless_it_has_a_name() -> None:
    rooms = Rooms(("corridor", "kitchen"), np.array([[0.0, 0.0, 40.0, 10.0], [20.0, 6.0, 26.0, 10.0]]))
    spots = [(1.0, 1.0), (21.0, 7.0), (50.0, 7.0), (2.0, 1.0)]
    named = with_names(made_map(spots, {}, names=["", "", "", "desk"]), rooms)
    assert named.names == ("corridor", "kitchen", "", "desk")
    assert named.named("kitchen").tolist() == [1]


def mapped(
    views: ComparedViews,
    place: Sequence[int],
    known: TopologicalMap | None = None,
    rooms: Rooms | None = None,
    pairs: Sequence[tuple[int, int]] = (),
    **parameters: int,
) -> TopologicalMap:
    found = made_hypotheses(views, place, pairs)
    return TopologicalMapping(**parameters).step(Context("mapping"), views, found, known, rooms).map


def seeing(looks: Sequence[float], *seen: LocalFeatures, **said: Any) -> ComparedViews:
    """Views of these looks, which show these features each, or all the same."""
    features = seen * len(looks) if len(seen) == 1 else seen
    return replace(made_views(between_looks(looks), **said), features=features)


RNG = np.random.default_rng(0)
LOOKS, BEARINGS = RNG.integers(0, 255, (40, 128)).astype(np.uint8), RNG.uniform(-math.pi, math.pi, 40)


def patches(rows: list[int] | range, turned: float = 0.0) -> LocalFeatures:
    """These of forty patches all around, as a robot sees them that is turned; of the odd ones only half as far."""
    at = BEARINGS[list(rows)] - turned
    return replace(features_of(LOOKS[list(rows)]), bearings=np.column_stack([np.cos(at), np.sin(at), 0.0 * at]))


def test_the_patches_that_a_view_keeps_are_those_found_again_around_it(monkeypatch: pytest.MonkeyPatch) -> None:
    # View 2 has 40 patches; its neighbours on both sides show 10 to 29 and 20 to 34: the ten in both come first.
    seen = [range(40), range(10, 30), range(40), range(20, 35), range(40)]
    views = seeing([0.0, 9.0, 20.0, 31.0, 43.0], *map(patches, seen))
    monkeypatch.setattr(WINDOW, 1)
    made = mapped(views, range(5), max_patches=12, min_path_matches=1)
    kept = made.views.features(2).descriptors
    assert [next(n for n in range(40) if (LOOKS[n] == row).all()) for row in kept] == [10, 11, *range(20, 30)]
    assert len(made.views.features(1).descriptors) == 12
    # A view of another tour is no neighbour: of equals the strongest stay.
    apart = replace(views, tours=np.array([1, 1, 2, 3, 3]))
    kept = mapped(apart, range(5), max_patches=12, min_path_matches=1).views.features(2).descriptors
    np.testing.assert_array_equal(kept, LOOKS[:12])


def test_the_spread_is_the_root_mean_square_over_all_views_but_the_medoids() -> None:
    map = made_map([(0.0, 0.0), (5.0, 0.0)], {})
    looks = [patches(range(20)), patches(range(20), 0.3), patches(range(20)), patches([*range(15), *range(25, 30)])]
    views = seeing([0.0] * 4, *looks)
    # The map keeps views 0 and 2 as they are; 1 has the same patches, turned: nothing between them but min_angle;
    # of 3 only 15 match: 20 / 15 times as far.
    stored_views = stored([looks[0], looks[2]], [views.descriptors[0]] * 2)
    map = replace(map, views=stored_views, frames=np.array([0, 20]))
    least = 0.01 / (2 * math.pi)
    spread = spread_to_medoids(map, views, np.array([0, 0, 1, 1]))
    assert spread == pytest.approx(math.sqrt((least**2 + (20 / 15 * least) ** 2) / 2), rel=1e-3)
    assert spread_to_medoids(map, views, np.array([0, 5, 1, 5])) == 0.0
    nothing = replace(views, features=(looks[0], patches(range(30, 40)), looks[2], patches(range(30, 40))))
    assert spread_to_medoids(map, nothing, np.array([0, 0, 1, 1])) == 0.0


def test_only_the_heaviest_segments_of_a_view_are_kept() -> None:
    weights = np.array([9.0, 5.0, 2.0], np.float32)
    columns = VerticalSegments(
        np.arange(3.0), np.zeros((3, 2)), np.zeros((3, 10), np.float32), weights, np.zeros((3, 2, 2))
    )
    views = seeing([0.0, 9.0], replace(patches(range(5)), columns=columns), patches(range(5)))
    made = mapped(views, [0, 1], pairs=[(0, 1)], max_segments=2)
    heaviest, none = made.views.features(0).columns, made.views.features(1).columns
    assert heaviest is not None
    assert heaviest.weights.tolist() == [9.0, 5.0]
    assert none is None
    assert made.links.tolist() == [[0, 1]]
    assert made.frames.tolist() == [0, 10]


@pytest.mark.parametrize(("least", "images"), [(1, 1), (0, 0)])
def test_between_medoids_are_path_images_unless_none_are_asked_for(
    monkeypatch: pytest.MonkeyPatch, least: int, images: int
) -> None:
    # From medoid to medoid it is three views of the drive, of which at most two may lie between path images.
    views = seeing([0.0, 0.1, 0.2, 9.0, 9.1, 9.2], patches(range(5)))
    monkeypatch.setattr("omninav.stages.mapping.topological.MAX_PATH_STEP", 2)
    made = mapped(views, [0, 0, 0, 1, 1, 1], min_path_matches=least)
    assert made.links.tolist() == [[0, 1]]
    assert made.frames[made.places].tolist() == [10, 40]
    assert len(made.path_of(0)) == images


@pytest.mark.parametrize(
    ("place", "names", "links"), [([0, 1, 0, 1], ("", "desk"), [[1, 0]]), ([0, 0, 0, 1], ("desk", ""), [[0, 1]])]
)
def test_a_known_map_keeps_its_links_and_names(
    place: list[int], names: tuple[str, ...], links: list[list[int]]
) -> None:
    # Known: from 1 to 0, and 1 is the desk. The tour drives from what looks as 0 to what looks as 1: the same link. Or
    # both known places have become one, with the name of either, and the tour leads on to a new place.
    known = made_map([(0.0, 0.0), (1.0, 0.0)], {(1, 0): 0}, names=["", "desk"])
    looks = [0.0, 10.0, 0.1, 10.1]
    views = seeing(looks, patches(range(5)), tours=[0, 0, 1, 1], owners=[0, 1, -1, -1])
    made = mapped(views, place, known, min_path_matches=6)
    assert made.names == names
    assert made.links.tolist() == links


def test_the_first_view_has_none_before_it(monkeypatch: pytest.MonkeyPatch) -> None:
    # Of the first view those patches come first that the second shows, not those that the last does.
    views = seeing([0.0, 9.0, 20.0], *map(patches, [range(40), range(10, 30), range(25, 40)]))
    monkeypatch.setattr(WINDOW, 1)
    made = mapped(views, range(3), max_patches=12)
    np.testing.assert_array_equal(made.views.features(0).descriptors, LOOKS[10:22])


@pytest.mark.parametrize(("source", "name"), [("truth", "hall"), ("odometry", "")])
def test_places_are_called_after_rooms_where_poses_are_true_and_a_spread_is_always_known(
    source: str, name: str
) -> None:
    # One view is its place's medoid: nothing is measured against it, and the spread within parts is 1 without any.
    views = made_views(between_looks([0.0]), pose_source=source)  # type: ignore[arg-type]
    made = mapped(views, [0], rooms=Rooms(("hall",), np.array([[-1.0, -1.0, 1.0, 1.0]])))
    assert (made.names, made.spread) == ((name,), 1.0)
    assert mapped(views, [0]).names == ("",)
    three = seeing([0.0, 0.1, 0.3], patches(range(20)))
    assert mapped(three, [0, 0, 0]).spread == pytest.approx(0.01 / (2 * math.pi), rel=1e-3)

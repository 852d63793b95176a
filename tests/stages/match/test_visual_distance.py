"""The present view against the places of a made-up world's map, and against one other view."""

from dataclasses import replace
from unittest.mock import MagicMock

import numpy as np
import pytest
from made_tour import Landmarks, along, mapped, scattered

from omninav.pipeline import Context
from omninav.pipeline.graph.problems import BadInput
from omninav.stages.match.correspondences import MatchFeatures
from omninav.stages.match.place_words import MatchPlaceWords
from omninav.stages.match.visual_distance import VisualDistance
from omninav.stages.values.local_features import GlobalDescriptor, LocalFeatures, VerticalSegments
from omninav.stages.values.pose import Pose
from omninav.stages.values.topological_map import TopologicalMap
from omninav.stages.values.visual_distance import VisualDistances

WORLD = Landmarks(scattered(40.0, 14.0, 400))
GREY = GlobalDescriptor(np.zeros(3, np.float32))


@pytest.fixture(scope="module")
def made() -> TopologicalMap:
    return mapped(WORLD, [along([(6.0, 7.0), (34.0, 7.0)], 1.0)]).map


def compared(features: LocalFeatures, map: TopologicalMap, moments: GlobalDescriptor = GREY) -> VisualDistances:
    stage, context = VisualDistance(), Context("match")
    stage.setup(context)
    found = stage.step(context, features=features, descriptor=moments, map=map).distances
    assert context.counts.get("nothing_in_common", 0) == np.isinf(found.distances).all()
    return found


def test_the_place_where_a_robot_stands_is_the_nearest_and_says_how_it_is_turned(made: TopologicalMap) -> None:
    for place in range(len(made)):
        x, y, heading = made.poses[made.places[place]]
        found = compared(WORLD.seen(Pose(x + 0.3, y - 0.3, heading + 2.0)), made)
        assert int(np.argmin(found.distances)) == place
        assert found.turns[place] == pytest.approx(2.0, abs=0.1)
        assert found.matches[place] > 20


def test_far_places_have_nothing_in_common_and_other_colours_are_not_looked_at(made: TopologicalMap) -> None:
    found = compared(WORLD.seen(Pose(6.0, 7.0, 0.0)), made)
    gap = np.abs(made.poses[made.places][:, 0] - 6.0)
    assert np.isinf(found.distances[gap > 16.0]).all()
    assert np.isfinite(found.distances[gap < 4.0]).all()
    assert np.isinf(
        compared(WORLD.seen(Pose(6.0, 7.0, 0.0)), made, GlobalDescriptor(np.ones(3, np.float32))).distances
    ).all()


def test_descriptors_of_another_kind_are_refused(made: TopologicalMap) -> None:
    seen = WORLD.seen(Pose(6.0, 7.0, 0.0))
    short = LocalFeatures(seen.bearings, seen.points, seen.descriptors[:, :64], seen.colours, seen.sizes)
    with pytest.raises(BadInput, match="use the features it was made with"):
        compared(short, made)


@pytest.mark.parametrize("search", ["all", "kd_tree"])
def test_correspondences_lead_from_the_present_view_to_the_target(search: str) -> None:
    here, there = WORLD.seen(Pose(10.0, 7.0, 0.5)), WORLD.seen(Pose(11.0, 7.0, 0.0))
    pairs = MatchFeatures(search=search).step(Context("match"), features=here, target=there).correspondences
    assert len(pairs) > 30
    assert (here.descriptors[pairs.first] == there.descriptors[pairs.second]).all()
    assert pairs.distance.max() == pytest.approx(0.0, abs=1e-3)
    assert len(np.unique(pairs.second)) == len(pairs)
    nothing = MatchFeatures(search=search).step(Context("match"), features=here, target=there.chosen(slice(0, 0)))
    assert len(nothing.correspondences) == 0


def test_both_ends_of_matching_columns_are_pairs_after_those_of_patches() -> None:
    looks = np.random.default_rng(0).normal(size=(12, 10)).astype(np.float32)
    columns = VerticalSegments(np.zeros(12), np.zeros((12, 2)), looks, np.ones(12, np.float32), np.zeros((12, 2, 2)))
    order = np.random.default_rng(1).permutation(12)
    patches = WORLD.seen(Pose(10.0, 7.0, 0.5))
    here = replace(patches.chosen(slice(0, 3)), columns=columns)
    there = replace(patches.chosen(slice(3, 8)), columns=columns.chosen(order))
    pairs = MatchFeatures().step(Context("match"), features=here, target=there).correspondences
    row_of = np.argsort(order)
    expected = [(3 + 2 * row + end, 5 + 2 * row_of[row] + end) for row in range(12) for end in (0, 1)]
    assert sorted(zip(pairs.first.tolist(), pairs.second.tolist(), strict=True)) == expected
    assert pairs.distance == pytest.approx(np.zeros(24), abs=1e-3)


def test_a_place_is_as_similar_by_words_as_its_most_similar_view() -> None:
    words = MagicMock(owner=np.array([0, 1, 1, 0] * 3), __len__=lambda _: 2)
    words.words.similarities.return_value = each = np.array([0.1, 0.2, 0.9, 0.3] * 3, np.float32)
    stage, given = MatchPlaceWords(), (Context("match"), WORLD.seen(Pose(6.0, 7.0, 0.0)))
    found = stage.step(*given, [0, 1], words)
    assert found.similarities.values == pytest.approx([0.3, 0.9])
    assert found.answers.references.tolist() == [2, 6, 10, 3, 7, 11, 1, 5, 9, 0]
    assert found.answers.similarities.tolist() == each[found.answers.references].tolist()
    assert stage.step(*given, [0, 1]).similarities is None
    with pytest.raises(BadInput, match="of 2 places, the map has 3"):
        stage.step(*given, [0, 1, 2], words)

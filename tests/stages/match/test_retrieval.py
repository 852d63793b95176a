import math

import numpy as np
import pytest
from made_references import references

from omninav.pipeline import Context, Tick
from omninav.pipeline.graph.problems import BadInput
from omninav.stages.geometry.appearance.segments import turned_views
from omninav.stages.match.reference_match import LastView
from omninav.stages.match.retrieval import Retrieval, best_answers, normalised_intersections, window_turns
from omninav.stages.values.features import SegmentHistograms
from omninav.stages.values.maps import ReferenceGraph
from omninav.stages.values.similarity import Similarities


def histograms(*shape: int, seed: int = 0, mass: float = 1.0) -> np.ndarray:
    values = np.random.default_rng(seed).random(shape).astype(np.float32) ** 6
    values[values < 0.1] = 0.0
    return mass * values / values.sum(axis=-1, keepdims=True)


def a_map(features: np.ndarray) -> ReferenceGraph:
    return references(np.zeros((len(features), 3)), features)


def test_two_histograms_are_intersected_as_equation_5_says() -> None:
    # sum min(q, d) = 0.1 + 0.2 + 0 + 0.3 = 0.6; sum q = 0.8, sum d = 1.0: 0.75 one way, 0.6 the other (erratum 43).
    query = np.array([[0.3, 0.2, 0.0, 0.3]], np.float32)
    kept = np.array([[0.1, 0.4, 0.1, 0.4]], np.float32)
    assert normalised_intersections(kept[None], query[None])[0, 0] == pytest.approx(0.75)
    assert normalised_intersections(query[None], kept[None])[0, 0] == pytest.approx(0.6)


def plain(references: np.ndarray, queries: np.ndarray, scales: int) -> np.ndarray:
    turns, segments = queries.shape[:2]
    q = queries.reshape(turns, segments, scales, -1)
    d = references.reshape(len(references), segments, scales, -1)
    values = np.zeros((len(references), turns))
    for own in range(scales):
        for other in range(scales):
            if own and other:
                continue
            one, two = q[None, :, :, own], d[:, None, :, other]
            alike = np.minimum(one, two).sum(axis=-1) / one.sum(axis=-1)
            values = np.maximum(values, alike.mean(axis=2))
    return values


@pytest.mark.parametrize(("segments", "scales", "turns"), [(1, 1, 1), (8, 1, 36), (4, 3, 5), (1, 2, 4)])
def test_all_segments_scales_and_turns_are_as_in_plain_numpy(segments: int, scales: int, turns: int) -> None:
    references = histograms(20, segments, scales * 30)
    queries = histograms(turns, segments, scales * 30, seed=1, mass=0.9)
    values = normalised_intersections(references, queries, scales)
    assert np.allclose(values, plain(references, queries, scales), atol=1e-5)
    chosen = np.array([3, 7, 11])
    assert np.array_equal(normalised_intersections(references, queries, scales, chosen), values[chosen])


def test_the_place_and_the_turn_are_found_and_answered_first() -> None:
    map = a_map(histograms(40, 8, 64))
    seen = SegmentHistograms(np.roll(map.features[7], 3, axis=0))
    out = Retrieval(headings=8).step(Context("match"), seen, map)
    assert out.answers is not None
    assert len(out.answers.references) == 9
    assert out.answers.references[0] == 7
    assert out.answers.similarities[0] == pytest.approx(1.0)
    assert out.answers.turns[0] == pytest.approx(2 * math.pi * 3 / 8)


def test_equal_answers_come_in_the_order_of_the_map_and_name_its_references() -> None:
    values = np.array([[0.5, 0.2], [0.1, 0.5], [0.9, 0.0], [0.5, 0.5]], np.float32)
    answers = best_answers(Similarities(values, np.array([4, 6, 7, 9])), 3)
    assert answers.references.tolist() == [7, 4, 6]
    assert answers.turns.tolist() == pytest.approx([0.0, 0.0, -math.pi])


def test_a_single_picture_has_one_heading() -> None:
    map = a_map(histograms(5, 1, 64))
    out = Retrieval().step(Context("match"), SegmentHistograms(map.features[2], np.zeros(1)), map)
    assert out.similarities.values.shape == (5, 1)
    assert out.similarities.values[2, 0] == pytest.approx(1.0)


def test_each_window_looks_where_the_reference_does_if_the_robot_is_turned() -> None:
    # Windows at 0, 90, 180, 270 degrees. The one that looks left (90) sees what a reference looking along its own
    # heading saw, if the robot's heading is 90 degrees *less*: column 3 of 4.
    directions = 2 * math.pi * np.arange(4) / 4
    assert window_turns(directions).tolist() == [0, 3, 2, 1]
    assert window_turns(np.array([0.0, math.pi, -math.pi / 2, math.pi / 2])).tolist() == [0, 2, 1, 3]
    map = a_map(histograms(6, 1, 64))
    view = histograms(4, 64, seed=3)
    view[1] = map.features[5, 0]
    values = Retrieval().step(Context("match"), SegmentHistograms(view, directions), map).similarities.values
    assert np.unravel_index(int(np.argmax(values)), values.shape) == (5, 3)


def test_windows_that_do_not_go_around_the_robot_are_refused() -> None:
    for directions in ([0.3], [0.0, 1.0], [0.0, 0.0]):
        with pytest.raises(BadInput, match=r"must be spaced evenly around the robot, one straight ahead, .* yaw: 0"):
            window_turns(np.array(directions))


def test_a_query_that_holds_nothing_is_like_nothing() -> None:
    map = a_map(histograms(4, 2, 16))
    nothing = SegmentHistograms(np.zeros((2, 16), np.float32))
    assert Retrieval(headings=4).step(Context("match"), nothing, map).similarities.values.tolist() == [[0.0] * 4] * 4


def test_a_map_of_other_features_is_refused() -> None:
    map = a_map(histograms(4, 8, 64))
    with pytest.raises(BadInput, match=r"8 segments x 64 bins, the current one is histograms of 8 x 32"):
        Retrieval().step(Context("match"), SegmentHistograms(histograms(8, 32)), map)
    with pytest.raises(BadInput, match=r"8 segments x 64 bins, the current one is histograms of 1 x 64"):
        Retrieval().step(Context("match"), SegmentHistograms(histograms(2, 64), np.array([0.0, math.pi])), map)
    colours = references(np.zeros((1, 3)), np.zeros((1, 8, 3), np.float32), "colours")
    with pytest.raises(BadInput, match="colours"):
        Retrieval().step(Context("match"), SegmentHistograms(np.full((8, 3), 0.2, np.float32)), colours)


def test_an_empty_map_has_no_answers() -> None:
    out = Retrieval().step(Context("match"), SegmentHistograms(histograms(8, 64)), ReferenceGraph.empty())
    assert out.similarities.values.shape == (0, 36)
    assert out.answers is None


def test_a_view_is_compared_with_the_one_before() -> None:
    views = histograms(30, 4, 20)
    stage, ctx, last = Retrieval(), Context("match"), LastView()
    said = []
    for index, view in ((0, views[0]), (1, np.roll(views[0], 1, axis=0)), (2, views[9]), (3, views[9]), (5, views[9])):
        ctx.tick = Tick(index, index, first_of_log=index in (0, 3))
        said.append(stage.step(ctx, SegmentHistograms(view), a_map(views), last=last).similarities.last_view)
    assert (said[0], said[3], said[4]) == (None, None, None)  # the first, of another log, and after a lost image
    assert said[1] == pytest.approx(1.0, abs=1e-6)  # turned on the spot
    assert said[2] == pytest.approx(float(normalised_intersections(views[:1], turned_views(views[9], 36)).max()))


def test_a_window_is_not_compared_with_the_one_before_for_a_robot_may_have_turned() -> None:
    map = a_map(histograms(30, 1, 20))
    stage, ctx, last = Retrieval(), Context("match"), LastView()
    for index in range(2):
        ctx.tick = Tick(index, index)
        seen = SegmentHistograms(map.features[2], np.zeros(1))
        assert stage.step(ctx, seen, map, last=last).similarities.last_view is None

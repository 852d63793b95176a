import numpy as np
import pytest
from made_references import references

from omninav.pipeline import Context, Tick
from omninav.pipeline.graph.problems import BadInput
from omninav.stages.match.histogram_intersection import HistogramIntersection
from omninav.stages.match.l2 import L2Match
from omninav.stages.match.reference_match import LastView
from omninav.stages.match.retrieval import Retrieval
from omninav.stages.match.selective import SelectiveMatch
from omninav.stages.values.candidates import Candidates
from omninav.stages.values.features import SegmentColours, SegmentHistograms
from omninav.stages.values.maps import ReferenceGraph
from omninav.stages.values.visual_words import WordSimilarities

SEGMENTS = 12


def a_map(number: int = 30) -> ReferenceGraph:
    features = np.random.default_rng(0).random((number, SEGMENTS, 20)).astype(np.float32) ** 3
    return references(np.zeros((number, 3)), features / features.sum(axis=2, keepdims=True))


MATCHES = [stage(headings=SEGMENTS) for stage in (SelectiveMatch, HistogramIntersection, L2Match, Retrieval)]


@pytest.mark.parametrize("match", MATCHES)
def test_the_place_and_the_turn_are_found_by_the_same_bytes_each_time(match: SelectiveMatch) -> None:
    map, turn = a_map(), 5
    seen = SegmentHistograms(np.roll(map.features[7], turn, axis=0))
    one, other = (match.step(Context("match"), seen, map).similarities.values for _ in range(2))
    assert np.unravel_index(int(np.argmax(one)), one.shape) == (7, turn)
    assert one.tobytes() == other.tobytes()
    assert one.dtype == np.float32


@pytest.mark.parametrize("match", MATCHES)
def test_a_candidate_is_compared_as_in_the_whole_map(match: SelectiveMatch) -> None:
    map = a_map(200)
    seen, chosen = SegmentHistograms(map.features[80]), np.array([3, 80, 199])
    some = match.step(Context("match"), seen, map, Candidates(chosen, np.array([1.0, 1.0, 198.0]))).similarities
    all_ = match.step(Context("match"), seen, map).similarities
    np.testing.assert_allclose(some.values, all_.values[chosen], atol=1e-6)
    assert np.array_equal(some.candidates, chosen)
    assert some.sampling_weight is not None
    assert some.sampling_weight.sum() == len(map)


def test_occluded_segments_count_against_a_view_as_each_match_says() -> None:
    map, seen = references(np.zeros((1, 3)), np.eye(2, dtype=np.float32)[None, [0, 0, 1, 1]]), np.eye(2)[[0] * 4]
    # The best two of four segments are equal: 2 sqrt(1 / 8); on average a half are; of squares 4 of 8 differ.
    for match, expected in ((SelectiveMatch, 0.5**0.5), (HistogramIntersection, 0.5), (L2Match, 1 - 0.5**0.5)):
        found = match(headings=1).step(Context("match"), SegmentHistograms(seen.astype(np.float32)), map)
        assert found.similarities.values == pytest.approx(np.array([[expected]]))


def test_a_map_of_other_features_is_refused_in_one_line() -> None:
    seen = SegmentColours(np.zeros((SEGMENTS, 3), np.float32))
    with pytest.raises(BadInput, match="its views are histograms of 12 segments x 20 bins") as refused:
        SelectiveMatch().step(Context("match"), seen, a_map())
    assert "\n" not in str(refused.value)


def test_visual_words_are_a_factor_of_each_reference() -> None:
    features = np.random.default_rng(0).dirichlet(np.ones(20), (3, 12)).astype(np.float32)
    map = references(np.zeros((3, 3)), features)
    words = WordSimilarities(np.array([1.0, 0.25, 0.04], np.float32))
    given = Context("match"), SegmentHistograms(features[1]), map, Candidates(np.array([0, 2]), np.ones(2))
    plain = HistogramIntersection().step(*given).similarities.values
    both = HistogramIntersection(word_power=0.5).step(*given, words).similarities.values
    assert both == pytest.approx(plain * [[1.0], [0.2]])
    assert np.array_equal(HistogramIntersection().step(*given, words).similarities.values, plain)
    assert np.array_equal(HistogramIntersection(word_power=0.5).step(*given).similarities.values, plain)
    for power, compared in ((0.0, True), (0.5, False)):  # the last view has no similarity by words
        ctx, last, stage = Context("match"), LastView(), HistogramIntersection(word_power=power)
        for index in range(2):
            ctx.tick = Tick(index, index)
            found = stage.step(ctx, given[1], map, None, words, last=last).similarities
        assert (found.last_view is not None) is compared

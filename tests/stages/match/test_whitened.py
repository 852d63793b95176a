"""Views compared after whitening by the map's own references."""

from typing import Any

import numpy as np
import pytest
from made_references import references

from omninav.pipeline import Context, Tick
from omninav.pipeline.graph.problems import BadInput
from omninav.stages.match.cosine import CosineMatch
from omninav.stages.match.reference_match import LastView
from omninav.stages.match.whitened import WhitenedMatch, learned_whitening
from omninav.stages.values.candidates import Candidates
from omninav.stages.values.features import SegmentColours, SegmentDescriptors
from omninav.stages.values.maps import ReferenceGraph
from omninav.stages.values.pose import Pose
from omninav.stages.values.similarity import Similarities

SEGMENTS = 12
COMMON = np.linspace(3.0, 9.0, 20)
"""What a network says of everything; what tells places apart is small beside it."""


def views(number: int, seed: int = 0) -> np.ndarray:
    own = np.random.default_rng(seed).normal(0.0, 0.3, (number, SEGMENTS, 20))
    return np.stack([SegmentDescriptors.of(COMMON + view).values for view in own])


def a_map(number: int = 30) -> ReferenceGraph:
    return references(np.zeros((number, 3)), views(number), "descriptors")


def matched(stage: CosineMatch | WhitenedMatch, view: np.ndarray, map: ReferenceGraph, **more: Any) -> Similarities:
    stage.setup(Context("match"))
    return stage.step(Context("match"), SegmentDescriptors.of(view), map, **more).similarities


def test_whitened_vectors_have_equal_variances_and_no_mean():
    vectors = np.random.default_rng(1).normal(size=(4000, 5)) * [9.0, 3.0, 3.0, 1.0, 1.0] + 7.0
    whitening = learned_whitening(vectors, 3)
    white = (vectors - whitening.mean) @ whitening.weights
    assert white.mean(axis=0) == pytest.approx(np.zeros(3), abs=1e-3)
    assert np.cov(white.T) == pytest.approx(np.eye(3), abs=0.03)  # a hundredth of the mean variance is added


def test_a_large_map_is_learned_from_references_at_even_steps_the_first_and_the_last_among_them(
    monkeypatch: pytest.MonkeyPatch,
):
    monkeypatch.setattr("omninav.stages.match.whitened.MAX_LEARNED", 3)
    stage, map = WhitenedMatch(components=6), a_map(7)
    values = matched(stage, map.features[5], map).values
    own = learned_whitening(map.features[[0, 3, 6]].reshape(-1, 20), 6)
    white = own.of(map.features[:])
    alike = np.einsum("nsk,sk->n", white, white[5]) / SEGMENTS
    assert values[:, 0] == pytest.approx(np.maximum(alike, 0.0), abs=1e-5)


def test_a_place_stands_out_from_views_that_a_network_finds_all_alike():
    map, seen = a_map(), np.roll(views(30)[7], 5, axis=0) + np.random.default_rng(2).normal(0, 0.005, (SEGMENTS, 20))
    plain = matched(CosineMatch(headings=SEGMENTS), seen, map).values
    white = matched(WhitenedMatch(headings=SEGMENTS), seen, map).values
    assert np.unravel_index(int(white.argmax()), white.shape) == (7, 5)
    assert np.sort(white.ravel())[-2] < 0.5 < np.sort(plain.ravel())[-2]


@pytest.mark.parametrize("stage", [CosineMatch(headings=SEGMENTS), WhitenedMatch(headings=SEGMENTS)])
def test_the_view_before_is_compared_as_a_reference_is(stage: CosineMatch | WhitenedMatch):
    map, last, ctx = a_map(), LastView(), Context("match")
    stage.setup(ctx)
    for index, view in enumerate((map.features[4], np.roll(map.features[7], 5, axis=0))):
        ctx.tick = Tick(index, index)
        found = stage.step(ctx, SegmentDescriptors.of(view), map, last=last).similarities
    assert found.last_view == pytest.approx(float(found.best[4]), abs=1e-5)


def test_a_candidate_is_compared_as_in_the_whole_map():
    map = a_map(200)
    chosen = np.array([3, 80, 199])
    some = matched(WhitenedMatch(), map.features[80], map, candidates=Candidates(chosen, np.ones(3))).values
    assert some == pytest.approx(matched(WhitenedMatch(), map.features[80], map).values[chosen], abs=1e-5)


def test_a_map_that_has_grown_is_learned_again():
    stage, map, late = WhitenedMatch(), a_map(4), views(5, seed=3)[4]
    before = matched(stage, late, map).values
    for view in views(5, seed=3):
        map.insert(Pose(0.0, 0.0, 0.0), view, "descriptors")
    after = stage.step(Context("match"), SegmentDescriptors.of(late), map).similarities.values
    assert after.shape == (9, 36)
    assert int(after.argmax()) // 36 == 8
    assert not np.allclose(after[:4], before)
    assert after.tobytes() == matched(WhitenedMatch(), late, map).values.tobytes()


def test_an_empty_map_has_no_similarities():
    empty = ReferenceGraph.empty()
    assert matched(WhitenedMatch(), views(1)[0], empty).values.shape == (0, 36)


def test_other_features_than_the_maps_are_refused():
    colours = SegmentColours(np.zeros((SEGMENTS, 3), np.float32))
    with pytest.raises(BadInput, match="its views are descriptors"):
        WhitenedMatch().step(Context("match"), colours, a_map())

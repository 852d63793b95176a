import numpy as np
import pytest

from omninav.pipeline import Context
from omninav.pipeline.graph.problems import BadInput
from omninav.stages.fusion.best_match import BestMatch
from omninav.stages.match.candidates import near_belief
from omninav.stages.match.histogram_intersection import HistogramIntersection
from omninav.stages.match.l2 import L2Match
from omninav.stages.match.selective import SelectiveMatch
from omninav.stages.values.belief import Particles
from omninav.stages.values.features import SegmentColours, SegmentHistograms
from omninav.stages.values.length_scale import LengthScale
from omninav.stages.values.maps import ReferenceGraph
from omninav.stages.values.similarity import Similarities

SEGMENTS = 12


def a_map(number: int = 30, spacing: float = 0.5, seed: int = 0) -> ReferenceGraph:
    rng = np.random.default_rng(seed)
    features = rng.random((number, SEGMENTS, 20)).astype(np.float32) ** 3
    features /= features.sum(axis=2, keepdims=True)
    poses = np.column_stack([spacing * np.arange(number), np.zeros(number), rng.uniform(-3, 3, number)])
    return ReferenceGraph(poses, features, "histograms", np.zeros((0, 2), np.int64), "truth")


def particles_at(x: float, y: float = 0.0, number: int = 50) -> Particles:
    poses = np.random.default_rng(1).normal((x, y, 0.0), (0.05, 0.05, 0.1), (number, 3))
    return Particles(poses, np.full(number, 1 / number))


MATCHES = [SelectiveMatch(headings=SEGMENTS), HistogramIntersection(headings=SEGMENTS), L2Match(headings=SEGMENTS)]


@pytest.mark.parametrize("match", MATCHES)
def test_the_place_and_the_turn_are_found(match: SelectiveMatch) -> None:
    map, turn = a_map(), 5
    seen = SegmentHistograms(np.roll(map.features[7], turn, axis=0))
    similarities = match.step(Context("match"), seen, map).similarities
    assert np.unravel_index(int(np.argmax(similarities.values)), similarities.values.shape) == (7, turn)
    best = BestMatch().step(Context("fusion"), similarities, map).belief
    assert best is not None
    expected = map.poses[7, 2] + 2 * np.pi * turn / SEGMENTS
    assert best.pose.x == map.poses[7, 0]
    assert np.exp(1j * best.pose.heading) == pytest.approx(np.exp(1j * expected))


@pytest.mark.parametrize("match", MATCHES)
def test_the_same_view_gives_the_same_bytes(match: SelectiveMatch) -> None:
    map = a_map()
    seen = SegmentHistograms(map.features[3])
    one, other = (match.step(Context("match"), seen, map).similarities.values for _ in range(2))
    assert one.tobytes() == other.tobytes()
    assert one.dtype == np.float32


def gaps_to(map: ReferenceGraph, belief: Particles) -> np.ndarray:
    return np.hypot(*(map.poses[:, None, :2] - belief.poses[:, :2]).transpose(2, 0, 1)).min(axis=1)


@pytest.mark.parametrize("radius", [0.4, 1.0, 3.0])
def test_near_a_belief_every_reference_within_the_radius_is_compared_for_itself(radius: float) -> None:
    map, belief = a_map(400, 0.1), particles_at(8.0)
    chosen, sampling_weight = near_belief(map.poses, belief, radius, 0.0, 0, 20, 3)
    assert chosen is not None
    assert sampling_weight is not None
    gap = gaps_to(map, belief)
    near = np.flatnonzero(gap <= radius)
    assert set(near) <= set(chosen)
    assert (sampling_weight[np.isin(chosen, near)] == 1).all()
    assert (gap[chosen] > 1.36 * radius).sum() <= 20
    assert (np.diff(chosen) > 0).all()


def test_around_recovery_particles_only_the_nearest_references_are_compared() -> None:
    map, tracked, hypotheses = a_map(400, 0.1), particles_at(8.0), particles_at(30.0)
    poses = np.concatenate([tracked.poses, hypotheses.poses])
    belief = Particles(poses, np.full(len(poses), 1 / len(poses)), recovery_particles=len(hypotheses.poses))
    chosen, sampling_weight = near_belief(map.poses, belief, 3.0, 0.5, 0, 0, 0)
    assert chosen is not None
    assert sampling_weight is not None
    near = (gaps_to(map, tracked) <= 3.0) | (gaps_to(map, hypotheses) <= 0.5)
    assert set(np.flatnonzero(near)) <= set(chosen)
    farther = (gaps_to(map, tracked) <= 1.36 * 3.0) | (gaps_to(map, hypotheses) <= 1.36 * 0.5)
    assert set(chosen) <= set(np.flatnonzero(farther))
    assert (sampling_weight == 1).all()
    alone, _ = near_belief(map.poses, belief, 3.0, 0.0, 0, 0, 0)
    without, _ = near_belief(map.poses, tracked, 3.0, 0.5, 0, 0, 0)
    assert alone is not None
    assert without is not None
    assert set(alone) == set(without)


def test_background_references_represent_the_whole_map_and_all_come_up() -> None:
    map, belief = a_map(400, 0.1), particles_at(8.0)
    seen: set[int] = set()
    for turn in range(60):
        chosen, sampling_weight = near_belief(map.poses, belief, 1.0, 0.0, 0, 20, turn)
        assert chosen is not None
        assert sampling_weight is not None
        assert sampling_weight.sum() == pytest.approx(400)
        seen |= set(chosen)
    assert len(seen) == 400
    # A sum over the map, estimated turn by turn, is right on average.
    value = np.random.default_rng(0).random(400)
    turns = [near_belief(map.poses, belief, 1.0, 0.0, 0, 20, turn) for turn in range(200)]
    sums = [(value[c] * w).sum() for c, w in turns if c is not None and w is not None]
    assert np.mean(sums) == pytest.approx(value.sum(), rel=0.005)


def test_what_is_compared_near_the_belief_is_what_it_is_everywhere() -> None:
    map = a_map(400, 0.1)
    seen, ctx = SegmentHistograms(map.features[80]), Context("match")
    stage = SelectiveMatch(
        headings=SEGMENTS, radius=2.0, length_scale_m=0.5, background_references=20, compare_all_up_to=0
    )
    near, all_ = stage.step(ctx, seen, map, particles_at(8.0)).similarities, stage.step(ctx, seen, map).similarities
    assert near.candidates is not None
    assert len(near.candidates) < 50 + 20
    assert np.array_equal(near.values, all_.values[near.candidates])
    far = stage.step(ctx, seen, map, particles_at(500.0)).similarities  # no reference near: look everywhere
    assert far.candidates is None


@pytest.mark.parametrize("match", [SelectiveMatch, HistogramIntersection, L2Match])
def test_the_radius_is_in_length_scales_of_the_map(match: type[SelectiveMatch]) -> None:
    map, belief = a_map(800, 0.1), particles_at(30.0)
    stage, seen = (
        match(headings=SEGMENTS, background_references=10, compare_all_up_to=0),
        SegmentHistograms(map.features[80]),
    )
    compared = []
    for reach in (0.1, 0.5, 2.0):
        candidates = stage.step(Context("match"), seen, map, belief, LengthScale(reach)).similarities.candidates
        assert candidates is not None
        assert set(np.flatnonzero(gaps_to(map, belief) <= 4.5 * reach)) <= set(candidates)
        compared.append(len(candidates))
    assert compared[0] < 40 < compared[1] < 130 < compared[2]


def test_small_maps_are_always_compared_whole() -> None:
    stage = SelectiveMatch(headings=SEGMENTS, compare_all_up_to=200)
    map = a_map(200, 0.1)
    out = stage.step(Context("match"), SegmentHistograms(map.features[0]), map, particles_at(8.0))
    assert out.similarities.candidates is None


def test_a_map_of_other_features_is_refused_in_one_line() -> None:
    seen = SegmentColours(np.zeros((SEGMENTS, 3), np.float32))
    with pytest.raises(BadInput, match="its views are histograms of 12 segments x 20 bins") as refused:
        SelectiveMatch().step(Context("match"), seen, a_map())
    assert "\n" not in str(refused.value)


def test_the_best_match_counts_in_the_map_s_own_indices() -> None:
    map = a_map()
    similarities = Similarities(np.array([[0.1, 0.2], [0.9, 0.3]], np.float32), np.array([4, 11]))
    best = BestMatch().step(Context("fusion"), similarities, map).belief
    assert best is not None
    assert best.pose.x == map.poses[11, 0]
    assert BestMatch().step(Context("f"), Similarities(np.zeros((0, 36), np.float32)), map).belief is None

"""Particles weighed by the view expected at their pose."""

import numpy as np
import pytest
from made_beliefs import even
from made_references import references
from view_at_turn import turned_view

from omninav.pipeline import Context
from omninav.pipeline.graph.problems import BadInput
from omninav.stages.geometry.appearance.segments import similarities
from omninav.stages.geometry.probability.evidence import contrast_power
from omninav.stages.match.cosine import CosineMatch
from omninav.stages.match.l2 import L2Match
from omninav.stages.match.selective import SelectiveMatch
from omninav.stages.sensor.expected_observation import ExpectedObservation, similarity_of_expected
from omninav.stages.sensor.near_references import NearReferences
from omninav.stages.sensor.nearest_cells import NearestCells
from omninav.stages.values.features import SegmentColours, SegmentHistograms
from omninav.stages.values.length_scale import LengthScale
from omninav.stages.values.similarity import Similarities

RNG = np.random.default_rng(0)
REFERENCES = np.column_stack([RNG.uniform(0, 4, (40, 2)), RNG.uniform(-3, 3, 40)])
FEATURES = RNG.random((40, 12, 20)).astype(np.float32) ** 4
FEATURES /= FEATURES.sum(axis=2, keepdims=True)
MAP = references(REFERENCES, FEATURES)


def test_the_expected_view_is_the_mean_of_the_nearest_turned_to_the_heading() -> None:
    poses, view = np.column_stack([RNG.uniform(0, 4, (30, 2)), RNG.uniform(-9, 9, 30)]), FEATURES[5]
    cells = NearestCells(REFERENCES, 3, 0.1, 6.0)
    found = similarity_of_expected(poses, REFERENCES, FEATURES, view, True, cells.of(poses), 2.0, 0.1)
    for pose, likeness in zip(poses, found, strict=True):
        centre = cells.origin + (np.floor((pose[:2] - cells.origin) / cells.cell) + 0.5) * cells.cell
        nearest = np.argsort(np.hypot(*(REFERENCES[:, :2] - centre).T))[:3]
        squares = np.square(REFERENCES[nearest, :2] - pose[:2]).sum(axis=1)
        weights = 1 / (squares + squares.min() / 4 + 1e-4 * 2.0**2)
        turned = [turned_view(FEATURES[n], float(pose[2] - REFERENCES[n, 2])) for n in nearest]
        expected = np.average(turned, axis=0, weights=weights).astype(np.float32)
        score, known = similarities(expected[None], view, 1, "histograms")[0, 0], np.exp(-0.5 * squares.min() / 2.0**2)
        assert likeness == pytest.approx(max(0.1, known * score + (1 - known) * 0.1), abs=2e-5)


def test_colours_are_compared_by_their_distance() -> None:
    colours = (RNG.random((40, 9, 3)) * 255).astype(np.float32)
    cells = NearestCells(REFERENCES, 1, 0.05, 3.0)
    found = similarity_of_expected(REFERENCES, REFERENCES, colours, colours[4], False, cells.of(REFERENCES), 1.0, 0.0)
    assert int(np.argmax(found)) == 4
    assert found[4] == pytest.approx(1.0, abs=0.01)


def test_the_particle_where_the_view_was_taken_wins() -> None:
    stage, ctx = ExpectedObservation(), Context("sensor", np.random.default_rng(0))
    stage.setup(ctx)
    seen = np.roll(FEATURES[3], 3, axis=0)  # a robot there, turned left by a quarter
    poses = np.array(
        [REFERENCES[3] + (0, 0, np.pi / 2), REFERENCES[3] - (0, 0, np.pi / 2), REFERENCES[7], [50.0, 50, 0]]
    )
    field = RNG.uniform(0.3, 0.5, (40, 12)).astype(np.float32)
    field[3, 3] = 1.0
    seen_here = Similarities(field, exponent=0.5), SegmentHistograms(seen), even(poses), MAP
    likelihood = stage.step(ctx, *seen_here, length_scale=LengthScale(0.1)).likelihood.values
    assert np.argmax(likelihood) == 0
    assert likelihood[0] > 100 * likelihood[1:].max()


@pytest.mark.parametrize("match", [SelectiveMatch(penalty="none"), SelectiveMatch(colour_scale=60.0), L2Match()])
def test_the_view_is_compared_as_the_match_compares_it(match: SelectiveMatch | L2Match) -> None:
    colours = (RNG.random((40, 9, 3)) * 60).astype(np.float32)
    map, seen = references(REFERENCES, colours, "colours"), colours[4] + 5
    alike = match.step(Context("match"), SegmentColours(seen), map).similarities
    stage, ctx = ExpectedObservation(power=5.0), Context("sensor", np.random.default_rng(0))
    stage.setup(ctx)
    seen_here = alike, SegmentColours(seen), even(REFERENCES), map
    likelihood = stage.step(ctx, *seen_here, length_scale=LengthScale(0.1)).likelihood.values
    # A particle at a reference is as likely as the best of the compared ones, and no other is much likelier.
    assert likelihood[4] == pytest.approx(1.0, abs=0.05)
    assert likelihood.max() < 1.05


def test_a_weight_is_a_power_of_s_however_far_the_references_are_and_whatever_they_reach() -> None:
    """Gross & Koenig 2004, section 2: S alone determines the weight. Two references of one bin at three segments: seen
    is half of the one's and a quarter of the other's mass in all segments, so that S is 0.5 and 0.25."""
    bins = np.zeros((2, 3, 3), np.float32)
    bins[:, :, 0], bins[0, :, 1], bins[1, :, 1] = [[0.5], [0.25]], 0.5, 0.75
    map = references([[0.0, 0.0, 0.0], [9.0, 0.0, 0.0]], bins)
    seen = SegmentHistograms(np.tile(np.float32([1.0, 0.0, 0.0]), (3, 1)))
    stage, ctx = ExpectedObservation(power=2.0, fade_distance=None, background_quantile=None), Context("sensor")
    stage.setup(ctx)
    poses = np.array([[0.0, 0.0, 0.3], [9.0, 0.0, -2.0], [0.0, -9e3, 0.0], [0.0, 30.0, 0.0]])
    for spread in (0.0, 0.4):  # how S varies over the map is nothing to a weight
        alike = Similarities(np.float32([[0.5], [0.5 - spread]]), exponent=0.5)
        values = stage.step(ctx, alike, seen, even(poses), map, None, LengthScale(1.0))
        weights = values.likelihood.values * 0.5**2  # the factor that all share
        assert weights[:2] == pytest.approx([0.5**2, 0.25**2], rel=1e-3)
        # 30 m away both are expected, by 1 / (d^2 + (d_min / 2)^2); beyond all of the map there is nothing to expect.
        shares = 1 / np.array([900 + 225, 981 + 225])
        assert weights[3] == pytest.approx(((shares @ [0.5, 0.25]) / shares.sum()) ** 2, rel=1e-3)
        assert weights[2] == 0.0


def test_by_the_norm_of_the_whole_difference_a_segment_that_differs_much_counts_more() -> None:
    # Two views, each 40 from the one expected in all: spread over nine segments, and in one of them.
    expected, spread, gathered = (np.full((9, 3), 100.0, np.float32) for _ in range(3))
    spread[:, 0] += 40 / 9
    gathered[0, 0] += 40
    near, at, scale = np.zeros((1, 1), np.int32), np.zeros((1, 3)), 442.0
    found = [
        similarity_of_expected(at, at, expected[None], view, False, near, 1.0, 0.0, None, scale)
        for view in (spread, gathered)
    ]
    assert found[0] == pytest.approx(1 - 40 / 3 / scale, abs=1e-5)
    assert found[1] == pytest.approx(1 - 40 / scale, abs=1e-5)


def test_whatever_compares_otherwise_is_refused() -> None:
    stage, ctx, seen = ExpectedObservation(), Context("sensor"), SegmentHistograms(FEATURES[4])
    stage.setup(ctx)
    alike = CosineMatch().step(Context("match"), seen, MAP).similarities
    with pytest.raises(BadInput, match="defines `exponent_and_scale`, as this one does not; use match=selective"):
        stage.step(ctx, alike, seen, even(REFERENCES), MAP)


@pytest.mark.parametrize("sensor", [ExpectedObservation(), NearReferences()])
def test_a_map_of_one_reference_weighs_particles_by_its_similarity(sensor: NearReferences) -> None:
    """Nothing is known of how similarities differ between references, and a view may be nearer than any compared."""
    assert contrast_power(np.array([0.9], np.float32), 3.0) == 1.0
    assert contrast_power(np.array([0.9, 0.9], np.float32), 3.0) == 1.0
    assert contrast_power(np.array([0.9, 0.8], np.float32), 3.0) == pytest.approx(3.0 / (0.5 * np.log(0.9 / 0.8)))
    ctx = Context("sensor", np.random.default_rng(0))
    sensor.setup(ctx)
    poses = REFERENCES[0] + np.array([[0.0, 0.0, turn] for turn in np.linspace(-3, 3, 50)])
    field = np.full((1, 12), 0.4, np.float32)
    out = sensor.step(
        ctx,
        Similarities(field, exponent=0.5),
        **({"features": SegmentHistograms(FEATURES[0])} if isinstance(sensor, ExpectedObservation) else {}),
        particles=even(poses),
        map=references(REFERENCES[:1], FEATURES[:1]),
    )
    assert 0.5 < out.likelihood.values.max() < 5.0

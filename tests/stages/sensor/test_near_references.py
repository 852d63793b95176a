"""Particles weighed by the references near them."""

import numpy as np
import pytest
from made_beliefs import even
from made_references import references

from omninav.pipeline import Context
from omninav.stages.sensor.near_references import (
    ComparedRows,
    NearReferences,
    background_similarity,
    expected_similarity,
    fading,
    similarity_field,
    weighted_quantile,
)
from omninav.stages.sensor.nearest_cells import NearestCells
from omninav.stages.values.length_scale import LengthScale
from omninav.stages.values.maps import ReferenceGraph
from omninav.stages.values.pose import Motion
from omninav.stages.values.similarity import Similarities

RNG = np.random.default_rng(0)
REFERENCES = np.column_stack([RNG.uniform(0, 4, (40, 2)), RNG.uniform(-3, 3, 40)])
FIELD = RNG.random((40, 36)).astype(np.float32)


def by_words(pose: np.ndarray, fade: float, ordinary: float, cell: float, neighbours: int, radius: float) -> float:
    origin = REFERENCES[:, :2].min(axis=0) - radius
    end = REFERENCES[:, :2].max(axis=0) + radius
    centre = origin + (np.floor((pose[:2] - origin) / cell) + 0.5) * cell
    gaps = np.hypot(*(REFERENCES[:, :2] - centre).T)
    chosen = [n for n in np.argsort(gaps, kind="stable")[:neighbours] if gaps[n] < radius]
    if not chosen or np.any(pose[:2] < origin) or np.any(pose[:2] > end):
        return ordinary
    squares = [float(np.sum((pose[:2] - REFERENCES[n, :2]) ** 2)) for n in chosen]
    total = mass = 0.0
    for n, square in zip(chosen, squares, strict=True):
        weight = 1 / (square + min(squares) / 4 + 1e-4 * fade**2)
        turn = np.mod((pose[2] - REFERENCES[n, 2]) * 36 / (2 * np.pi), 36)
        total += weight * float(np.interp(turn, np.arange(37), np.append(FIELD[n], FIELD[n, 0])))
        mass += weight
    known = np.exp(-0.5 * min(squares) / fade**2)
    return float(max(ordinary, known * total / mass + (1 - known) * ordinary))


@pytest.mark.parametrize("fade", [0.2, 0.5, 1.0])
def test_the_kernel_agrees_with_a_plain_implementation(fade: float) -> None:
    poses = np.column_stack([RNG.uniform(-1, 5, (60, 2)), RNG.uniform(-9, 9, 60)])
    cells = NearestCells(REFERENCES, 4, 0.1, 3 * fade)
    found = expected_similarity(poses, REFERENCES, cells.of(poses), np.arange(40), FIELD, fade, 0.3)
    words = [by_words(pose, fade, 0.3, cells.cell, 4, 3 * fade) for pose in poses]
    assert np.allclose(found, words, atol=1e-6)
    assert (found > 0.3).any()
    not_compared = np.full(40, -1)
    assert np.allclose(expected_similarity(poses, REFERENCES, cells.of(poses), not_compared, FIELD, fade, 0.3), 0.3)


def test_references_fade_as_a_gaussian_or_never() -> None:
    assert fading(2.0) == pytest.approx((4e-4, -0.125))  # (2 cm)^2, and 1 / (2 x 2^2)
    assert fading(None) == (1e-4, 0.0)


def step(
    stage: NearReferences,
    poses: np.ndarray,
    field: np.ndarray,
    motion: Motion | None = None,
    length_scale: LengthScale | None = None,
) -> NearReferences.Out:
    ctx = Context("sensor", np.random.default_rng(0))
    stage.setup(ctx)
    return stage.step(ctx, Similarities(field), even(poses), references(REFERENCES), motion, length_scale)


def one_good_match() -> np.ndarray:
    field = np.full((40, 36), 0.5, np.float32)
    field[3, 9] = 0.9  # at reference 3, for a robot turned left by a quarter
    return field


def test_the_particle_at_the_matching_reference_and_heading_wins() -> None:
    right = REFERENCES[3] + np.array([0.0, 0.0, np.pi / 2])
    poses = np.array([right, REFERENCES[3] - (0.0, 0.0, np.pi / 2), REFERENCES[7], [50.0, 50.0, 0.0]])
    likelihood = step(NearReferences(), poses, one_good_match(), None, LengthScale(0.1)).likelihood.values
    assert np.argmax(likelihood) == 0
    assert likelihood[0] > 100 * likelihood[1:].max()


def test_off_the_map_is_as_likely_as_the_background() -> None:
    field = RNG.uniform(0.3, 0.5, (40, 36)).astype(np.float32)
    poses = np.concatenate([REFERENCES, [[50.0, 50.0, 0.0]]])
    values = step(NearReferences(background_quantile=0.5), poses, field, None, LengthScale(0.2)).likelihood.values
    assert values.min() > 0
    assert values[-1] == pytest.approx(values.min())
    assert np.isclose(values, values[-1]).sum() > len(poses) / 4


def test_the_background_is_a_quantile_over_the_references_of_other_places() -> None:
    best = np.array([0.9, 0.8, 0.3, 0.5, 0.4], np.float32)
    places = np.array([[0, 0], [0.5, 0], [3, 0], [4, 0], [5, 0]], float)
    assert background_similarity(best, places, 1.0, 0.5) == pytest.approx(0.4)
    assert background_similarity(best, places, 1.0, 1.0) == pytest.approx(0.5)
    assert background_similarity(best, places, 9.0, 1.0) == pytest.approx(0.5)  # no background: the median of all
    assert background_similarity(best, places, 9.0, 1.0, np.array([1.0, 1, 90, 1, 1])) == pytest.approx(0.3, abs=0.005)
    # The one at 4 m stands for ninety: the median is its own.
    assert background_similarity(best, places, 1.0, 0.5, np.array([1.0, 1, 1, 90, 1])) == pytest.approx(0.5, abs=0.003)


def test_a_weighted_quantile_is_that_of_repeated_values() -> None:
    values, weights = RNG.random(300).astype(np.float32), RNG.integers(1, 20, 300)
    many = np.repeat(values, weights)
    for quantile in (0.1, 0.5, 0.8):
        assert weighted_quantile(values, weights.astype(float), quantile) == pytest.approx(
            float(np.quantile(many, quantile)), abs=0.01
        )


def test_a_sample_of_references_gives_the_mean_weight_of_the_whole_map() -> None:
    # What every tenth reference says of the map, each standing for ten, is what all of them say.
    field = RNG.normal(0.5, 0.05, (5000, 36)).astype(np.float32).clip(0, 1)
    whole = similarity_field(Similarities(field), 0.5, 0.7, 8.0)
    some = similarity_field(Similarities(field[::10], np.arange(0, 5000, 10), np.full(500, 10.0)), 0.5, 0.7, 8.0)
    assert some.mean == pytest.approx(whole.mean, rel=0.01)
    assert whole.mean == pytest.approx(float(((np.maximum(field, 0.5) / 0.7) ** 8.0).mean()), rel=1e-6)


def test_without_a_power_it_follows_from_how_much_similarity_varies_between_places() -> None:
    field = np.repeat(np.exp(RNG.normal(-0.5, 0.02, 40))[:, None], 36, axis=1).astype(np.float32)
    flat, steep = (step(NearReferences(), REFERENCES, values).likelihood.values for values in (field, field**3))
    given = step(NearReferences(power=3.0 / float(np.log(field[:, 0]).std())), REFERENCES, field).likelihood.values
    assert flat == pytest.approx(steep, rel=1e-3)  # a world of thrice the contrast: the same weights
    assert flat == pytest.approx(given, rel=1e-4)


def test_distances_are_in_length_scales() -> None:
    poses = REFERENCES + np.array([0.3, 0.0, np.pi / 2])
    slow, quick = (
        step(NearReferences(), poses, one_good_match(), None, LengthScale(reach)).likelihood.values
        for reach in (1.0, 0.05)
    )
    assert slow[3] > 100 * np.median(slow)  # 0.3 m is near where views change slowly
    assert quick[3] < 1.01 * np.median(quick)  # and far where they change quickly


def test_the_next_image_of_a_standing_robot_is_little_evidence() -> None:
    poses, stage = REFERENCES + np.array([0.0, 0.0, np.pi / 2]), NearReferences(independence_distance=0.4)
    moving = step(stage, poses, one_good_match(), Motion(0.5, 0.0, 0.0)).likelihood.values
    standing = step(stage, poses, one_good_match(), Motion(0.0, 0.0, 1.0)).likelihood.values
    half = step(stage, poses, one_good_match(), Motion(0.06, 0.08, 0.0)).likelihood.values
    assert np.allclose(standing, moving**0.05)
    assert np.allclose(half, moving**0.5)


def test_the_mean_likelihood_takes_the_whole_evidence_of_an_image() -> None:
    # To a robot kidnapped just now the image is new.
    stage = NearReferences(independence_distance=0.4)
    moving = step(stage, REFERENCES, one_good_match(), Motion(0.5, 0.0, 0.0)).likelihood
    standing = step(stage, REFERENCES, one_good_match(), Motion(0.0, 0.0, 0.0)).likelihood
    assert (moving.novelty, standing.novelty) == (1.0, 0.05)
    assert standing.mean_likelihood == moving.mean_likelihood


def test_an_empty_comparison_weights_all_particles_alike() -> None:
    ctx, stage = Context("sensor"), NearReferences()
    stage.setup(ctx)
    alike = Similarities(np.zeros((0, 36), np.float32))
    out = stage.step(ctx, alike, even(np.zeros((7, 3))), ReferenceGraph.empty())
    assert np.array_equal(out.likelihood.values, np.ones(7))


def test_only_what_was_compared_last_has_a_row() -> None:
    rows = ComparedRows(6)
    for compared in ([1, 4], [0, 1, 5], None, [3]):
        chosen, found = rows.of(None if compared is None else np.array(compared))
        wanted = range(6) if compared is None else compared
        assert chosen.tolist() == list(wanted)
        assert found.tolist() == [list(wanted).index(n) if n in wanted else -1 for n in range(6)]

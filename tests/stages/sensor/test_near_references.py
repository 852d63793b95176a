"""Particles weighed by the references near them."""

import numpy as np
import pytest

from omninav.pipeline import Context
from omninav.stages.geometry.plane.nearest_cells import nearest_cells
from omninav.stages.sensor.near_references import (
    Field,
    NearReferences,
    expected_similarity,
    ordinary_match,
    weighted_quantile,
)
from omninav.stages.values.belief import Particles
from omninav.stages.values.length_scale import LengthScale
from omninav.stages.values.maps import ReferenceGraph
from omninav.stages.values.pose import Motion
from omninav.stages.values.similarity import Similarities

RNG = np.random.default_rng(0)
REFERENCES = np.column_stack([RNG.uniform(0, 4, (40, 2)), RNG.uniform(-3, 3, 40)])
FIELD = RNG.random((40, 36)).astype(np.float32)


def a_map() -> ReferenceGraph:
    return ReferenceGraph(
        REFERENCES, np.zeros((40, 1, 1), np.float32), "histograms", np.zeros((0, 2), np.int64), "truth"
    )


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
def test_the_kernel_agrees_with_its_words(fade: float) -> None:
    poses = np.column_stack([RNG.uniform(-1, 5, (60, 2)), RNG.uniform(-9, 9, 60)])
    cells = nearest_cells(REFERENCES, 4, 0.1, 3 * fade)
    found = expected_similarity(poses, REFERENCES, cells, np.arange(40), FIELD, fade, 0.3)
    words = [by_words(pose, fade, 0.3, cells.cell, 4, 3 * fade) for pose in poses]
    assert np.allclose(found, words, atol=1e-6)
    assert (found > 0.3).any()


def test_references_that_were_not_compared_say_nothing() -> None:
    poses = REFERENCES[:5].copy()
    cells = nearest_cells(REFERENCES, 4, 0.1, 1.5)
    found = expected_similarity(poses, REFERENCES, cells, np.full(40, -1), FIELD, 0.5, 0.3)
    assert np.allclose(found, 0.3)


def step(
    stage: NearReferences, poses: np.ndarray, field: np.ndarray, motion: Motion | None = None
) -> NearReferences.Out:
    ctx = Context("sensor", np.random.default_rng(0))
    stage.setup(ctx)
    return stage.step(ctx, Similarities(field), Particles(poses, np.full(len(poses), 1 / len(poses))), a_map(), motion)


def one_good_match() -> np.ndarray:
    field = np.full((40, 36), 0.5, np.float32)
    field[3, 9] = 0.9  # at reference 3, for a robot turned left by a quarter
    return field


def test_the_particle_at_the_matching_reference_and_heading_wins() -> None:
    right = REFERENCES[3] + np.array([0.0, 0.0, np.pi / 2])
    poses = np.array([right, REFERENCES[3] - (0.0, 0.0, np.pi / 2), REFERENCES[7], [50.0, 50.0, 0.0]])
    likelihood = step(NearReferences(reach_m=0.1), poses, one_good_match()).likelihood.values
    assert np.argmax(likelihood) == 0
    assert likelihood[0] > 100 * likelihood[1:].max()


def test_off_the_map_is_as_likely_as_any_ordinary_match() -> None:
    field = RNG.uniform(0.3, 0.5, (40, 36)).astype(np.float32)
    poses = np.concatenate([REFERENCES, [[50.0, 50.0, 0.0]]])
    values = step(NearReferences(ordinary=0.5, reach_m=0.2), poses, field).likelihood.values
    assert values.min() > 0
    assert values[-1] == pytest.approx(values.min())
    assert np.isclose(values, values[-1]).sum() > len(poses) / 4


def test_the_ordinary_match_is_a_quantile_over_the_references_of_other_places() -> None:
    best = np.array([0.9, 0.8, 0.3, 0.5, 0.4], np.float32)
    places = np.array([[0, 0], [0.5, 0], [3, 0], [4, 0], [5, 0]], float)
    assert ordinary_match(best, places, 1.0, 0.5) == pytest.approx(0.4)
    assert ordinary_match(best, places, 1.0, 1.0) == pytest.approx(0.5)
    assert ordinary_match(best, places, 9.0, 1.0) == pytest.approx(0.5)  # no strangers: the median of all
    # The one at 4 m stands for ninety: the median is its own.
    assert ordinary_match(best, places, 1.0, 0.5, np.array([1.0, 1, 1, 90, 1])) == pytest.approx(0.5, abs=0.003)


def test_a_quantile_of_what_stands_for_many_is_that_of_the_many() -> None:
    values, weights = RNG.random(300).astype(np.float32), RNG.integers(1, 20, 300)
    many = np.repeat(values, weights)
    for quantile in (0.1, 0.5, 0.8):
        assert weighted_quantile(values, weights.astype(float), quantile) == pytest.approx(
            float(np.quantile(many, quantile)), abs=0.01
        )


def test_some_references_stand_for_the_whole_map() -> None:
    # What every tenth reference says of the map, each standing for ten, is what all of them say.
    field = RNG.normal(0.5, 0.05, (5000, 36)).astype(np.float32).clip(0, 1)
    whole = Field(field, 0.5, 0.7, 8.0)
    some = Field(field[::10], 0.5, 0.7, 8.0, np.full(500, 10.0))
    assert some.mean == pytest.approx(whole.mean, rel=0.01)
    assert whole.mean == pytest.approx(float(((np.maximum(field, 0.5) / 0.7) ** 8.0).mean()), rel=1e-6)


def test_cells_are_drawn_by_weight_and_by_how_many_they_stand_for() -> None:
    field = np.full((3, 4), 0.1, np.float32)
    field[0, 1] = field[2, 3] = 1.0
    each = np.array([1.0, 5.0, 3.0])
    drawn = Field(field, 0.5, 1.0, 2.0, each).draw(np.random.default_rng(0), 40_000)
    # By hand: each cell weighs its value, or the floor, squared, as often as its reference counts.
    weights = (np.maximum(field, 0.5) ** 2 * each[:, None]).ravel()
    shares = np.bincount(drawn, minlength=12) / 40_000
    assert shares == pytest.approx(weights / weights.sum(), abs=0.01)
    assert shares[1] == pytest.approx(1 / 12, abs=0.004)


@pytest.mark.parametrize("floor", [0.0, 2.0])
def test_where_all_or_nothing_rises_above_the_floor_cells_are_drawn_by_weight_too(floor: float) -> None:
    field = np.array([[0.2, 0.4], [0.8, 0.6]], np.float32)
    drawn = Field(field, floor, 1.0, 1.0).draw(np.random.default_rng(0), 40_000)
    weights = np.maximum(field, floor).ravel()
    assert np.bincount(drawn, minlength=4) / 40_000 == pytest.approx(weights / weights.sum(), abs=0.01)


def test_the_power_follows_from_how_much_similarity_varies_between_places() -> None:
    best = np.exp(RNG.normal(-0.5, 0.02, 500)).astype(np.float32)
    flat, steep = NearReferences()._power(best), NearReferences()._power(best**3)
    assert flat == pytest.approx(3.0 / 0.02, rel=0.1)
    assert flat == pytest.approx(3 * steep, rel=1e-3)  # a world of thrice the contrast: the same weights
    assert NearReferences(power=7.0)._power(best) == 7.0


def test_distances_are_meant_in_reaches() -> None:
    poses = REFERENCES + np.array([0.3, 0.0, np.pi / 2])
    ctx, stage = Context("sensor"), NearReferences()
    belief = Particles(poses, np.full(40, 1 / 40))

    def at(reach: float) -> np.ndarray:
        stage.setup(ctx)
        return stage.step(
            ctx, Similarities(one_good_match()), belief, a_map(), None, LengthScale(reach)
        ).likelihood.values

    assert at(1.0)[3] > 100 * np.median(at(1.0))  # 0.3 m is near where views change slowly
    assert at(0.05)[3] < 1.01 * np.median(at(0.05))  # and far where they change quickly


def test_a_robot_that_stands_learns_little_from_the_next_picture() -> None:
    poses, stage = REFERENCES + np.array([0.0, 0.0, np.pi / 2]), NearReferences(independent=0.4, standing=0.1)
    moving = step(stage, poses, one_good_match(), Motion(0.5, 0.0, 0.0)).likelihood.values
    standing = step(stage, poses, one_good_match(), Motion(0.0, 0.0, 1.0)).likelihood.values
    half = step(stage, poses, one_good_match(), Motion(0.06, 0.08, 0.0)).likelihood.values
    assert np.allclose(standing, moving**0.1)
    assert np.allclose(half, moving**0.5)


@pytest.mark.parametrize("propose", ["similarity", "uniform"])
def test_proposals_are_drawn_from_the_field_and_around_the_references(propose: str) -> None:
    proposals = step(NearReferences(propose=propose, proposals=400, spread=0.1), REFERENCES, one_good_match()).proposals  # type: ignore[arg-type]
    assert proposals is not None
    assert proposals.weights.sum() == pytest.approx(1.0)
    gap = np.hypot(*(proposals.poses[:, None, :2] - REFERENCES[:, :2]).transpose(2, 0, 1))
    assert gap.min(axis=1).max() < 0.4
    at_the_match = (gap[:, 3] < 0.2).mean()
    assert at_the_match > 0.9 if propose == "similarity" else at_the_match < 0.2


def test_uniform_proposals_carry_their_own_likelihood() -> None:
    out = step(
        NearReferences(propose="uniform", proposals=20_000, spread=0.05, reach_m=0.1), REFERENCES, one_good_match()
    )
    assert out.proposals is not None
    assert out.likelihood.mean_likelihood is not None
    gap = np.hypot(*(out.proposals.poses[:, :2] - REFERENCES[3, :2]).T)
    turn = np.angle(np.exp(1j * (out.proposals.poses[:, 2] - REFERENCES[3, 2] - np.pi / 2)))
    fits = (gap < 0.15) & (np.abs(turn) < 0.2)
    assert 0 < fits.mean() < 0.01
    assert out.proposals.weights[fits].sum() > 100 * fits.mean()
    # Few draws may miss the place: then they must not carry what it would have carried.
    missed = step(NearReferences(propose="uniform", proposals=2, reach_m=0.1), REFERENCES, one_good_match())
    assert missed.likelihood.mean_likelihood is not None
    assert missed.likelihood.mean_likelihood < 0.1 * out.likelihood.mean_likelihood


def test_a_robot_that_stands_may_still_have_been_put_there() -> None:
    # For who was put there just now the picture is the first one: all of its evidence is new.
    stage = NearReferences(independent=0.4, standing=0.1)
    moving = step(stage, REFERENCES, one_good_match(), Motion(0.5, 0.0, 0.0)).likelihood
    standing = step(stage, REFERENCES, one_good_match(), Motion(0.0, 0.0, 0.0)).likelihood
    assert (moving.novelty, standing.novelty) == (1.0, 0.1)
    assert standing.mean_likelihood == moving.mean_likelihood


def test_an_empty_comparison_says_nothing() -> None:
    ctx, stage = Context("sensor"), NearReferences()
    stage.setup(ctx)
    empty = ReferenceGraph.empty()
    belief = Particles(np.zeros((7, 3)), np.full(7, 1 / 7))
    out = stage.step(ctx, Similarities(np.zeros((0, 36), np.float32)), belief, empty)
    assert np.array_equal(out.likelihood.values, np.ones(7))

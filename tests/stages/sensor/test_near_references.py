import numpy as np
import pytest

from omninav.pipeline import Context
from omninav.stages.geometry.nearby import nearby_grid
from omninav.stages.sensor.near_references import NearReferences, expected_similarity, ordinary_match
from omninav.stages.values.belief import Particles
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


def by_words(pose: np.ndarray, radius: float, elsewhere: float, trust: float) -> float:
    total, mass = trust * elsewhere, trust
    for reference, row in zip(REFERENCES, FIELD, strict=True):
        gap = np.hypot(*(pose[:2] - reference[:2]))
        if gap < radius:
            weight = (1 - gap**2 / radius**2) ** 2
            turn = np.mod((pose[2] - reference[2]) * 36 / (2 * np.pi), 36)
            value = np.interp(turn, np.arange(37), np.append(row, row[0]))
            total, mass = total + weight * value, mass + weight
    return float(total / mass)


@pytest.mark.parametrize("radius", [0.3, 0.8, 2.0])
def test_the_kernel_agrees_with_its_words(radius: float) -> None:
    poses = np.column_stack([RNG.uniform(-1, 5, (60, 2)), RNG.uniform(-9, 9, 60)])
    grid = nearby_grid(REFERENCES, radius)
    found = expected_similarity(poses, REFERENCES, grid, np.arange(40), FIELD, radius, 0.3, 0.05)
    assert np.allclose(found, [by_words(pose, radius, 0.3, 0.05) for pose in poses], atol=1e-6)


def test_references_that_were_not_compared_say_nothing() -> None:
    poses = REFERENCES[:5].copy()
    grid = nearby_grid(REFERENCES, 0.5)
    found = expected_similarity(poses, REFERENCES, grid, np.full(40, -1), FIELD, 0.5, 0.3, 0.05)
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
    likelihood = step(NearReferences(radius_m=0.2), poses, one_good_match()).likelihood.values
    assert np.argmax(likelihood) == 0
    assert likelihood[0] > 100 * likelihood[1:].max()


def test_off_the_map_is_as_likely_as_any_ordinary_match() -> None:
    field = RNG.uniform(0.3, 0.5, (40, 36)).astype(np.float32)
    poses = np.concatenate([REFERENCES, [[50.0, 50.0, 0.0]]])
    values = step(NearReferences(ordinary=0.5), poses, field).likelihood.values
    assert values.min() > 0
    assert values[-1] == pytest.approx(values.min())
    assert np.isclose(values, values[-1]).sum() > len(poses) / 4


def test_the_ordinary_match_is_a_quantile_over_references_at_their_best_headings() -> None:
    field = np.array([[0.1, 0.5], [0.7, 0.2], [0.3, 0.3]], np.float32)
    assert ordinary_match(field, 0.5) == pytest.approx(0.5)
    assert ordinary_match(field, 1.0) == pytest.approx(0.7)


def test_a_robot_that_stands_learns_little_from_the_next_picture() -> None:
    poses, stage = REFERENCES + (0.0, 0.0, np.pi / 2), NearReferences(independent_m=0.2, standing=0.1)
    moving = step(stage, poses, one_good_match(), Motion(0.5, 0.0, 0.0)).likelihood.values
    standing = step(stage, poses, one_good_match(), Motion(0.0, 0.0, 1.0)).likelihood.values
    half = step(stage, poses, one_good_match(), Motion(0.06, 0.08, 0.0)).likelihood.values
    assert np.allclose(standing, moving**0.1)
    assert np.allclose(half, moving**0.5)


@pytest.mark.parametrize("propose", ["similarity", "uniform"])
def test_proposals_are_drawn_from_the_field_and_around_the_references(propose: str) -> None:
    proposals = step(
        NearReferences(propose=propose, proposals=400, spread_m=0.05), REFERENCES, one_good_match()
    ).proposals  # type: ignore[arg-type]
    assert proposals is not None
    assert proposals.weights.sum() == pytest.approx(1.0)
    gap = np.hypot(*(proposals.poses[:, None, :2] - REFERENCES[:, :2]).transpose(2, 0, 1))
    assert gap.min(axis=1).max() < 0.4
    at_the_match = (gap[:, 3] < 0.2).mean()
    assert at_the_match > 0.9 if propose == "similarity" else at_the_match < 0.2


def test_an_empty_comparison_says_nothing() -> None:
    ctx, stage = Context("sensor"), NearReferences()
    stage.setup(ctx)
    empty = ReferenceGraph.empty()
    belief = Particles(np.zeros((7, 3)), np.full(7, 1 / 7))
    out = stage.step(ctx, Similarities(np.zeros((0, 36), np.float32)), belief, empty)
    assert np.array_equal(out.likelihood.values, np.ones(7))

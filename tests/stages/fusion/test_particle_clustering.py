from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from omninav.pipeline import Context
from omninav.stages.fusion.particle_clustering import ParticleClustering, clusters
from omninav.stages.values.belief import GaussianMixture, Particles


def cloud(centre: tuple[float, float, float], sigma: float, number: int, seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).normal(centre, sigma, (number, 3))


def gather(poses: np.ndarray, weights: np.ndarray | None = None, **options: Any) -> GaussianMixture:
    weights = np.full(len(poses), 1 / len(poses)) if weights is None else weights
    return ParticleClustering(**options).step(Context("state"), Particles(poses, weights)).state


def test_two_clouds_become_two_gaussians_with_their_weights() -> None:
    poses = np.concatenate([cloud((0, 0, 0), 0.1, 750), cloud((5, 5, 1), 0.1, 250, 1)])
    state = gather(poses)
    assert state.weights == pytest.approx([0.75, 0.25])
    assert state.means == pytest.approx(np.array([[0, 0, 0], [5, 5, 1]]), abs=0.03)
    assert np.sqrt(np.diagonal(state.covariances, axis1=1, axis2=2)) == pytest.approx(0.1, rel=0.15)


def test_a_cloud_across_half_a_turn_is_one_and_keeps_its_mean() -> None:
    poses = cloud((1, 2, np.pi), 0.1, 500)
    poses[:, 2] = np.mod(poses[:, 2] + np.pi, 2 * np.pi) - np.pi
    state = gather(poses)
    assert len(state) == 1
    assert abs(state.means[0, 2]) == pytest.approx(np.pi, abs=0.02)
    assert np.sqrt(state.covariances[0, 2, 2]) == pytest.approx(0.1, rel=0.1)


def test_particles_all_over_the_place_tell_no_state() -> None:
    poses = np.random.default_rng(0).uniform(-500, 500, (1000, 3))
    assert len(gather(poses)) == 0


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 10_000), st.integers(1, 60))
def test_clusters_are_what_touching_cells_make_of_them_one_by_one(seed: int, number: int) -> None:
    poses = np.random.default_rng(seed).uniform((-2, -2, -10), (2, 2, 10), (number, 3))
    cells = [
        (int(np.floor(x / 0.5)), int(np.floor(y / 0.5)), int(np.mod(h, 2 * np.pi) * 12 / (2 * np.pi)) % 12)
        for x, y, h in poses
    ]
    group = list(range(number))
    for _ in range(number):  # the plain way: take over the smallest label of whoever touches, until nothing changes
        for n, (a, b, c) in enumerate(cells):
            group[n] = min(
                group[m]
                for m, (d, e, f) in enumerate(cells)
                if abs(a - d) <= 1 and abs(b - e) <= 1 and min((c - f) % 12, (f - c) % 12) <= 1
            )
    found = clusters(poses, 0.5, np.radians(30.0))
    assert np.array_equal(found[:, None] == found, np.array(group)[:, None] == np.array(group))


def test_clusters_at_the_least_weight_stay_and_weights_are_shares_of_all(monkeypatch: pytest.MonkeyPatch) -> None:
    poses = np.array([[0.0, 0.0, 0.0], [9.0, 0.0, 0.0], [18.0, 0.0, 0.0]])
    monkeypatch.setattr("omninav.stages.fusion.particle_clustering.MIN_WEIGHT", 0.375)
    state = gather(poses, np.array([4.0, 3.0, 1.0]))
    assert state.means[:, 0].tolist() == [0.0, 9.0]
    assert state.weights == pytest.approx([4 / 7, 3 / 7])

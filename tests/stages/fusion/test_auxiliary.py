import numpy as np
import pytest

from omninav.pipeline import Context
from omninav.stages.fusion.agreement import Agreement
from omninav.stages.fusion.auxiliary import auxiliary_filter
from omninav.stages.geometry.plane.odometry_motion import move_poses
from omninav.stages.values.belief import GaussianMixture, Particles
from omninav.stages.values.pose import UncertainMotion

AHEAD = UncertainMotion((0.0, 1.0, 0.0), (0.0, 0.3, 0.0))


def at(x: float, sigma: float) -> GaussianMixture:
    return GaussianMixture(np.array([[x, 0.0, 0.0]]), np.diag([sigma**2, 1.0, 1.0])[None], np.ones(1))


def known(number: int) -> Particles:
    poses = np.random.default_rng(0).normal(0.0, (0.2, 0.0, 0.0), (number, 3))
    return Particles(poses, np.full(number, 1 / number))


def test_its_mean_and_variance_are_those_of_the_exact_filter() -> None:
    # N(0, 0.2^2) moved by N(1, 0.3^2) is N(1, 0.13); times N(1.4, 0.3^2): mean (1/.13 + 1.4/.09) / (1/.13 + 1/.09).
    out = auxiliary_filter(known(100_000), AHEAD, at(1.4, 0.3), 0.0, np.random.default_rng(1))
    assert out is not None
    precision = 1 / 0.13 + 1 / 0.09
    mean = float(out.weights @ out.poses[:, 0])
    assert mean == pytest.approx((1 / 0.13 + 1.4 / 0.09) / precision, abs=0.005)
    assert float(out.weights @ (out.poses[:, 0] - mean) ** 2) == pytest.approx(1 / precision, rel=0.03)


def test_the_view_counts_once() -> None:
    # The same view weighed twice would shrink the variance to that of two views, 1 / (1/.13 + 2/.09).
    out = auxiliary_filter(known(100_000), AHEAD, at(1.0, 0.3), 0.0, np.random.default_rng(1))
    assert out is not None
    variance = float(out.weights @ (out.poses[:, 0] - 1.0) ** 2)
    assert variance > 1.5 / (1 / 0.13 + 2 / 0.09)


def test_where_the_motion_is_certain_all_particles_weigh_alike() -> None:
    still = UncertainMotion((0.0, 1.0, 0.0), (0.0, 0.0, 0.0))
    out = auxiliary_filter(known(1000), still, at(1.2, 0.3), 0.0, np.random.default_rng(1))
    assert out is not None
    assert out.weights == pytest.approx(1 / 1000)


def test_as_an_option_it_gives_the_belief_of_importance_sampling_up_to_chance() -> None:
    before = known(50_000)
    rng = np.random.default_rng(2)
    particles = Particles(
        move_poses(before.poses, AHEAD.steps, AHEAD.sigmas, rng.standard_normal((3, 50_000))), before.weights
    )
    beliefs = [
        Agreement(sampling=sampling).step(Context("fusion"), particles, at(1.4, 0.3), before, AHEAD).belief
        for sampling in ("importance", "auxiliary")
    ]
    means = [float(belief.weights @ belief.poses[:, 0]) for belief in beliefs]
    assert means[0] == pytest.approx(means[1], abs=0.01)
    assert not np.array_equal(beliefs[0].weights, beliefs[1].weights)

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from made_mixtures import Mixture, gap, mixtures

from omninav.pipeline import Context
from omninav.stages.geometry.plane.odometry_motion import decompose_motion, motion_gaussian, move_gaussians
from omninav.stages.geometry.plane.se2 import compose
from omninav.stages.motion.gaussian import GaussianMotion
from omninav.stages.motion.rotation_translation_rotation import MeasuredNoise, RotationTranslationRotation
from omninav.stages.values.belief import GaussianMixture, Particles
from omninav.stages.values.pose import Motion

CTX = Context("motion")
metres, turns = st.floats(-1, 1), st.floats(-3, 3)


@given(mixtures(), metres, metres, turns)
def test_means_move_as_poses_do_and_weights_stay(mixture: Mixture, x: float, y: float, turn: float) -> None:
    belief = GaussianMixture(*mixture)
    out = GaussianMotion().step(CTX, belief, Motion(x, y, turn)).belief
    for before, after in zip(belief.means, out.means, strict=True):
        assert np.abs(gap(compose(before, (x, y, turn)), after)).max() < 1e-8
    assert np.array_equal(out.weights, belief.weights)
    assert np.linalg.eigvalsh(out.covariances).min() > 0.0


def test_the_linearised_motion_has_the_moments_of_the_sampled_one() -> None:
    # Small angles: what the linearisation leaves out is of second order.
    start = np.array([1.0, 2.0, 3.1])
    covariance = np.array([[0.04, 0.01, 0.002], [0.01, 0.03, -0.001], [0.002, -0.001, 0.002]])
    motion, number = Motion(0.8, 0.1, 0.3), 400_000
    rng = np.random.default_rng(0)
    poses = start + rng.multivariate_normal(np.zeros(3), covariance, number)
    ctx = Context("motion", rng)
    sampled = RotationTranslationRotation().step(
        ctx, Particles(poses, np.full(number, 1 / number)), motion, MeasuredNoise()
    )
    belief = GaussianMixture(start[None], covariance[None], np.ones(1))
    out = GaussianMotion().step(ctx, belief, motion)
    apart = np.stack([sampled.belief.poses[:, i] - out.belief.means[0, i] for i in range(3)], axis=1)
    apart[:, 2] = np.angle(np.exp(1j * apart[:, 2]))
    assert apart.mean(axis=0) == pytest.approx([0, 0, 0], abs=0.003)
    assert np.cov(apart.T) == pytest.approx(out.belief.covariances[0], abs=4e-4)
    assert out.model is not None
    assert (out.model.steps, out.model.sigmas) == (sampled.model.steps, sampled.model.sigmas)


def test_both_motion_stages_have_the_same_parameters() -> None:
    assert vars(GaussianMotion()) == vars(RotationTranslationRotation())


def test_without_motion_the_mixture_stays_and_there_is_no_model() -> None:
    belief = GaussianMixture(np.zeros((1, 3)), np.eye(3)[None], np.ones(1))
    out = GaussianMotion().step(CTX, belief, None)
    assert out.belief is belief
    assert out.model is None


def test_a_motion_as_one_increment_moves_a_certain_pose_to_the_same_gaussian() -> None:
    way, sigmas = decompose_motion(-0.4, 0.1, 0.5), (0.03, 0.05, 0.02)
    step, covariance = motion_gaussian(way, sigmas)
    start = np.array([[2.0, -1.0, 3.0]])
    mean, wanted = move_gaussians(start, np.zeros((1, 3, 3)), way, sigmas)
    assert step == pytest.approx([-0.4, 0.1, 0.5])
    assert compose(start[0], step) == pytest.approx(mean[0])
    cos, sin = math.cos(3.0), math.sin(3.0)
    turn = np.array([[cos, -sin, 0], [sin, cos, 0], [0, 0, 1]])
    assert turn @ covariance @ turn.T == pytest.approx(wanted[0], abs=1e-15)


def test_ten_thousand_motions_keep_covariances_positive_definite() -> None:
    rng, stage = np.random.default_rng(1), GaussianMotion()
    belief = GaussianMixture(np.zeros((1, 3)), np.diag([1e-4, 1e-4, 1e-6])[None], np.ones(1))
    for x, y, turn in rng.normal(0, [0.2, 0.02, 0.2], (10_000, 3)):
        belief = stage.step(CTX, belief, Motion(float(x), float(y), float(turn))).belief
        np.linalg.cholesky(belief.covariances[0])
    assert -math.pi <= belief.means[0, 2] < math.pi

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from omninav.pipeline import Context
from omninav.stages.geometry.plane.odometry_motion import decompose_motion, move_poses
from omninav.stages.geometry.plane.se2 import compose, wrap
from omninav.stages.motion.odometry_noise_model import FLOOR_M, FLOOR_RAD
from omninav.stages.motion.rotation_translation_rotation import MeasuredNoise, RotationTranslationRotation
from omninav.stages.values.belief import Particles
from omninav.stages.values.pose import Motion


@given(st.floats(-2, 2), st.floats(-2, 2), st.floats(-3, 3), st.floats(-3, 3))
def test_without_noise_the_motion_is_the_composition(x: float, y: float, turn: float, heading: float) -> None:
    start = np.array([[1.0, -2.0, heading]])
    reached = move_poses(start, decompose_motion(x, y, turn), (0.0, 0.0, 0.0), np.zeros((3, 1)))
    wanted = compose(start, (x, y, turn))
    assert np.allclose(reached[:, :2], wanted[:, :2], atol=1e-8)
    assert abs(float(wrap(reached[0, 2] - wanted[0, 2]))) < 1e-8


def test_going_backwards_is_no_turn() -> None:
    assert decompose_motion(-0.5, 0.0, 0.0) == pytest.approx((0.0, -0.5, 0.0), abs=1e-12)


def test_samples_have_the_spread_that_the_parameters_say() -> None:
    # One metre ahead and a turn of 0.5: each parameter's share by hand from the docstring's formulas.
    stage = RotationTranslationRotation(
        rotation_per_rotation=0.1,
        rotation_per_metre=0.02,
        translation_per_metre=0.05,
        translation_per_rotation=0.04,
    )
    number = 200_000
    ctx = Context("motion", np.random.default_rng(3))
    start = Particles(np.zeros((number, 3)), np.full(number, 1 / number))
    poses = stage.step(ctx, start, Motion(1.0, 0.0, 0.5), MeasuredNoise()).belief.poses
    way = math.sqrt(0.05**2 + 0.04**2 * 0.5 + FLOOR_M**2)
    first = math.sqrt((0.1**2 * 0.5 + 0.02**2 + FLOOR_RAD**2) / 2)
    heading = math.sqrt(2) * first
    assert poses[:, 0].mean() == pytest.approx(math.exp(-(first**2) / 2), abs=1e-3)
    assert poses[:, 0].std() == pytest.approx(way, rel=0.01)
    assert poses[:, 1].std() == pytest.approx(first, rel=0.01)
    assert poses[:, 2].mean() == pytest.approx(0.5, abs=1e-3)
    assert poses[:, 2].std() == pytest.approx(heading, rel=0.01)


def test_without_motion_the_belief_stays() -> None:
    belief = Particles(np.ones((5, 3)), np.full(5, 0.2))
    assert RotationTranslationRotation().step(Context("motion"), belief, None, MeasuredNoise()).belief is belief


def test_weights_pass_unchanged_and_the_input_is_not_written_to() -> None:
    poses, weights = np.zeros((4, 3)), np.array([0.1, 0.2, 0.3, 0.4])
    given_belief, ctx = Particles(poses, weights), Context("motion", np.random.default_rng(0))
    out = RotationTranslationRotation().step(ctx, given_belief, Motion(1, 0, 0), MeasuredNoise()).belief
    assert np.array_equal(out.weights, weights)
    assert not poses.any()

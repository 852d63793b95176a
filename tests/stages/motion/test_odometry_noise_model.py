"""The noise that grows with distance and turn."""

import math

import pytest

from omninav.stages.motion.odometry_noise_model import OdometryNoiseModel
from omninav.stages.values.pose import AssumedMotion, BridgedMotion, Motion

NO_FLOOR = OdometryNoiseModel(rotation_floor=0.0, translation_floor=0.0)


@pytest.mark.parametrize("parts", [2, 10])
def test_many_small_motions_are_as_uncertain_as_their_sum(parts: int):
    whole, part = NO_FLOOR.sigmas((0.2, 3.0, 0.1)), NO_FLOOR.sigmas((0.2 / parts, 3.0 / parts, 0.1 / parts))
    assert [math.sqrt(parts) * sigma for sigma in part] == pytest.approx(whole)


def test_a_metre_and_a_turn_by_one_radian_are_as_uncertain_as_stated():
    first, translation, second = NO_FLOOR.sigmas((0.0, 1.0, 0.0))
    assert translation == pytest.approx(0.1)
    assert math.hypot(first, second) == pytest.approx(0.05)  # both rotations together
    first, translation, second = NO_FLOOR.sigmas((1.0, 0.0, 0.0))
    assert translation == pytest.approx(0.01)
    assert math.hypot(first, second) == pytest.approx(0.05)


def test_a_robot_that_stands_still_keeps_the_floor_of_uncertainty():
    model = OdometryNoiseModel(rotation_floor=0.02, translation_floor=0.03)
    uncertain = model.model(Motion(0.0, 0.0, 0.0))
    assert math.hypot(uncertain.sigmas[0], uncertain.sigmas[2]) == pytest.approx(0.02)
    assert uncertain.sigmas[1] == pytest.approx(0.03)


def test_wheel_jitter_sideways_is_no_turn():
    sideways = NO_FLOOR.model(Motion(0.0, 1e-6, 0.0))
    assert sideways.sigmas[0] < 1e-4


def test_seconds_that_odometry_says_nothing_of_add_a_turn_and_a_way_each_by_its_own_rate():
    model = OdometryNoiseModel(rotation_floor=0.0, translation_floor=0.0, unmeasured_turn=0.3, unmeasured_speed=0.7)
    first, translation, second = model.model(BridgedMotion(0.0, 0.0, 0.0, 2.0)).sigmas
    assert math.hypot(first, second) == pytest.approx(0.6)
    assert translation == pytest.approx(1.4)


def test_a_guessed_motion_adds_its_own_uncertainty():
    first, translation, second = NO_FLOOR.model(AssumedMotion(0.0, 0.0, 0.0, sigma_m=0.4, sigma_turn=0.2)).sigmas
    assert math.hypot(first, second) == pytest.approx(0.2)
    assert translation == pytest.approx(0.4)

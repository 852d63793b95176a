"""The noise that grows with distance and turn."""

import math

import pytest

from omninav.stages.motion import odometry_noise_model
from omninav.stages.motion.odometry_noise_model import (
    FLOOR_M,
    FLOOR_RAD,
    UNMEASURED_M_S,
    OdometryNoiseModel,
)
from omninav.stages.values.pose import AssumedMotion, BridgedMotion, Motion

MODEL = OdometryNoiseModel()


def without_floor(sigmas: tuple[float, float, float]) -> tuple[float, float, float]:
    first, translation, second = sigmas
    return (
        math.sqrt(first**2 - FLOOR_RAD**2 / 2),
        math.sqrt(translation**2 - FLOOR_M**2),
        math.sqrt(second**2 - FLOOR_RAD**2 / 2),
    )


@pytest.mark.parametrize("parts", [2, 10])
def test_many_small_motions_are_as_uncertain_as_their_sum(parts: int):
    whole = without_floor(MODEL.sigmas((0.2, 3.0, 0.1)))
    part = without_floor(MODEL.sigmas((0.2 / parts, 3.0 / parts, 0.1 / parts)))
    assert [math.sqrt(parts) * sigma for sigma in part] == pytest.approx(whole)


def test_a_metre_and_a_turn_by_one_radian_are_as_uncertain_as_stated():
    first, translation, second = without_floor(MODEL.sigmas((0.0, 1.0, 0.0)))
    assert translation == pytest.approx(0.1)
    assert math.hypot(first, second) == pytest.approx(0.05)  # both rotations together
    first, translation, second = without_floor(MODEL.sigmas((1.0, 0.0, 0.0)))
    assert translation == pytest.approx(0.01)
    assert math.hypot(first, second) == pytest.approx(0.05)


def test_a_robot_that_stands_still_keeps_the_floor_of_uncertainty():
    uncertain = MODEL.model(Motion(0.0, 0.0, 0.0))
    assert math.hypot(uncertain.sigmas[0], uncertain.sigmas[2]) == pytest.approx(FLOOR_RAD)
    assert uncertain.sigmas[1] == pytest.approx(FLOOR_M)


def test_wheel_jitter_sideways_is_no_turn():
    sideways = MODEL.model(Motion(0.0, 1e-6, 0.0))
    assert without_floor(sideways.sigmas)[0] < 1e-4


def test_seconds_that_odometry_says_nothing_of_add_a_turn_and_a_way_each_by_its_own_rate(
    monkeypatch: pytest.MonkeyPatch,
):
    monkeypatch.setattr(odometry_noise_model, "UNMEASURED_RAD_S", 0.3)
    first, translation, second = without_floor(MODEL.model(BridgedMotion(0.0, 0.0, 0.0, 2.0)).sigmas)
    assert math.hypot(first, second) == pytest.approx(0.6)
    assert translation == pytest.approx(2 * UNMEASURED_M_S)


def test_a_guessed_motion_adds_its_own_uncertainty():
    first, translation, second = without_floor(
        MODEL.model(AssumedMotion(0.0, 0.0, 0.0, sigma_m=0.4, sigma_turn=0.2)).sigmas
    )
    assert math.hypot(first, second) == pytest.approx(0.2)
    assert translation == pytest.approx(0.4)

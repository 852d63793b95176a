"""The drive and what the wheels make of it."""

import math

import numpy as np
import pytest

from omninav.stages.geometry.plane.se2 import between, wrap
from omninav.stages.simulator.config import OdometryNoise, Robot
from omninav.stages.simulator.obstacles import gather
from omninav.stages.simulator.odometry import Bias, draw_bias, odometry
from omninav.stages.simulator.robot import at_rest, drive, limits, steer

CORNER = ((0.0, 0.0), (4.0, 0.0), (4.0, 3.0))
EXACT = OdometryNoise(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
NO_BIAS = Bias(0.0, 0.0, 0.0)


def test_a_drive_starts_at_rest_at_the_first_waypoint_and_ends_at_the_last() -> None:
    driven = drive(CORNER, Robot(), rate=20.0)
    times, poses = driven.times, driven.poses
    np.testing.assert_allclose(np.diff(times), 0.05)
    np.testing.assert_allclose(poses[0], [0.0, 0.0, 0.0])
    assert math.hypot(poses[-1, 0] - 4.0, poses[-1, 1] - 3.0) < 0.15
    assert math.hypot(poses[1, 0], poses[1, 1]) < 0.01


def test_limits_of_speed_turning_and_acceleration_hold() -> None:
    robot = Robot()
    poses = drive(CORNER, robot, rate=20.0).poses
    motion = between(poses[:-1], poses[1:]) * 20.0
    speed = np.hypot(motion[:, 0], motion[:, 1])
    assert speed.max() <= robot.speed * 1.001
    assert np.abs(motion[:, 2]).max() <= robot.turn_speed * 1.001
    assert np.abs(np.diff(speed)).max() * 20.0 <= robot.acceleration * 1.05


@pytest.mark.parametrize("rate", [1.0, 30.0, 66.0, 150.0, 1000.0])
def test_a_drive_takes_as_long_at_any_rate(rate: float) -> None:
    driven = drive(CORNER, Robot(), rate)
    assert driven.times[-1] == pytest.approx(drive(CORNER, Robot(), rate=20.0).times[-1], abs=max(0.1, 1.1 / rate))
    state = at_rest((0.0, 0.0, 0.0))
    for _ in range(round(4 * rate)):
        steer(state, 0.45, 0.0, limits(Robot()), 1.0 / rate, gather(np.empty((0, 6)), (90.0, 90.0), 0.0))
    assert state[0] == pytest.approx(4 * 0.45 - 0.2, abs=0.01)


def test_wheels_do_not_slip_sideways() -> None:
    poses = drive(CORNER, Robot(), rate=20.0).poses
    motion = between(poses[:-1], poses[1:])
    # On an arc the chord leaves at half the turn; a second step may turn at another rate.
    sideways = motion[:, 1] - motion[:, 0] * np.tan(motion[:, 2] / 2)
    assert np.abs(sideways).max() < 1e-3


@pytest.mark.parametrize("behind", [((0.0, 0.0), (2.0, 0.0), (0.0, 0.1)), ((0.0, 0.0), (1.0, 0.0), (1.0, 0.0))])
def test_sharp_turns_and_repeated_waypoints_are_driven(behind: tuple[tuple[float, float], ...]) -> None:
    poses = drive(behind, Robot(), rate=20.0).poses
    assert np.isfinite(poses).all()
    assert math.hypot(poses[-1, 0] - behind[-1][0], poses[-1, 1] - behind[-1][1]) < 0.2


def test_every_drive_ends_where_its_way_does_however_sharp_its_turns() -> None:
    """Zigzags that a joystick would not drive: without a rule for it, some circle round their next point for ever."""
    rng = np.random.default_rng(0)
    for _ in range(60):
        line = np.cumsum(rng.uniform(-2.0, 2.0, (8, 2)), axis=0)
        way = float(np.hypot(*np.diff(line, axis=0).T).sum())
        driven = drive(line, Robot(), rate=20.0)
        assert driven.times[-1] < 2.0 * way / 0.45 + 20.0
        assert math.dist(driven.poses[-1, :2], line[-1]) < 0.15


def test_a_robot_that_turns_round_where_its_way_will_end_drives_on() -> None:
    """Close to the last point it turns no more, but only when it is about to arrive."""
    driven = drive(((0.0, 0.0), (2.0, 0.0), (0.0, 0.0), (1.97, 0.0)), Robot(), rate=20.0)
    assert driven.poses[200:, 0].min() < 0.5
    assert driven.times[-1] < 25.0


def test_a_line_that_was_cut_in_a_bend_ends_where_it_was_cut() -> None:
    """The robot is beside the line there, a hand's breadth from its end: it has arrived, and does not wait for ever."""
    for radius in (0.15, 0.3, 0.5):
        for angle in (0.5, 1.0, 1.5, 2.0, 2.5, 3.0):
            turned = np.linspace(0.0, angle, 30)
            bend = np.stack([2.0 + radius * np.sin(turned), radius - radius * np.cos(turned)], axis=1)
            driven = drive(np.concatenate([[(0.0, 0.0)], bend]), Robot(), rate=20.0)
            assert driven.times[-1] < (2.0 + radius * angle) / 0.45 + 10.0
            assert math.dist(driven.poses[-1, :2], bend[-1]) < 0.15


def test_odometry_without_noise_is_the_drive_itself() -> None:
    poses = drive(CORNER, Robot(), rate=20.0).poses
    seen = odometry(poses, EXACT, NO_BIAS, np.random.default_rng(0))
    np.testing.assert_allclose(between(seen[:-1], seen[1:]), between(poses[:-1], poses[1:]), atol=1e-12)
    np.testing.assert_allclose(seen[-1], between(poses[0], poses[-1]), atol=1e-9)


def test_biases_scale_translation_and_rotation_and_bend_the_straight() -> None:
    straight = np.stack([np.linspace(0.0, 10.0, 201), np.zeros(201), np.zeros(201)], axis=1)
    spot = np.stack([np.zeros(101), np.zeros(101), np.linspace(0.0, 2.0, 101)], axis=1)
    rng = np.random.default_rng(0)
    assert odometry(straight, EXACT, Bias(0.03, 0.0, 0.0), rng)[-1, 0] == pytest.approx(10.3)
    assert odometry(straight, EXACT, Bias(0.0, 0.0, 0.01), rng)[-1, 2] == pytest.approx(0.1)
    assert odometry(spot, EXACT, Bias(0.0, 0.05, 0.0), rng)[-1, 2] == pytest.approx(2.1)


@pytest.mark.parametrize("steps", [10, 500])
def test_a_robot_that_slides_along_a_wall_without_turning_is_not_measured_to_turn(steps: int) -> None:
    slid = np.stack([np.linspace(0.0, 2.0, steps + 1), np.zeros(steps + 1), np.full(steps + 1, 0.8)], axis=1)
    rng = np.random.default_rng(5)
    turned = [odometry(slid, OdometryNoise(), NO_BIAS, rng)[-1, 2] for _ in range(800)]
    assert np.std(turned) == pytest.approx(0.0122 * math.sqrt(2.0), rel=0.1)


def test_noise_grows_with_the_root_of_the_way_and_of_the_turn() -> None:
    """One metre straight: sigma of length 0.02, of heading 0.7 degrees; a turn of 1 rad: 1.2 degrees."""
    noise = OdometryNoise(scale_bias=0.0, rotation_bias=0.0, turn_bias=0.0)
    straight = np.stack([np.linspace(0.0, 1.0, 21), np.zeros(21), np.zeros(21)], axis=1)
    spot = np.stack([np.zeros(21), np.zeros(21), np.linspace(0.0, 1.0, 21)], axis=1)
    rng = np.random.default_rng(3)
    ends = np.array([odometry(straight, noise, NO_BIAS, rng)[-1] for _ in range(1500)])
    turned = np.array([odometry(spot, noise, NO_BIAS, rng)[-1, 2] for _ in range(1500)])
    assert ends[:, 0].std() == pytest.approx(0.02, rel=0.08)
    assert math.degrees(ends[:, 2].std()) == pytest.approx(0.7, rel=0.08)
    assert math.degrees(turned.std()) == pytest.approx(1.2, rel=0.08)


def test_over_a_whole_drive_noise_and_biases_add_up_to_what_their_spreads_say() -> None:
    """The heading at the end of a circle, from the four parts that the settings name."""
    angles = np.linspace(0.0, 2 * math.pi, 801)
    circle = np.stack([3 * np.sin(angles), 3 - 3 * np.cos(angles), angles], axis=1)
    way, turn, noise = 6 * math.pi, 2 * math.pi, OdometryNoise()
    days = [np.random.default_rng(day) for day in range(1500)]
    ends = wrap(np.array([odometry(circle, noise, draw_bias(noise, day), day)[-1, 2] for day in days]))
    by_hand = 0.0122**2 * way + 0.021**2 * turn + (0.0044 * way) ** 2 + (0.015 * turn) ** 2
    assert np.sqrt(np.mean(ends**2)) == pytest.approx(math.sqrt(by_hand), rel=0.06)


def test_the_biases_of_many_days_have_the_stated_spread() -> None:
    noise = OdometryNoise()
    days = [draw_bias(noise, np.random.default_rng(day)) for day in range(800)]
    assert np.std([day.translation for day in days]) == pytest.approx(noise.scale_bias, rel=0.1)
    assert np.std([day.rotation for day in days]) == pytest.approx(noise.rotation_bias, rel=0.1)
    assert np.std([day.turn for day in days]) == pytest.approx(noise.turn_bias, rel=0.1)

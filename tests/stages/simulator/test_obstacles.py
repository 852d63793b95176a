"""Clearance, beams and contacts, against shapes worked by hand and brute force."""

import math

import numpy as np
import pytest
from world_files import DEMO

from omninav.stages.geometry.plane.se2 import between
from omninav.stages.simulator.bodies import box_array
from omninav.stages.simulator.config import Kidnapping, Ranges, Robot
from omninav.stages.simulator.obstacles import Obstacles, beam, gather, nearest
from omninav.stages.simulator.ranges import measure
from omninav.stages.simulator.robot import (
    COLLISIONS,
    DISTANCE,
    HEADING,
    NO_PEOPLE,
    SPEED,
    at_rest,
    drive,
    limits,
    reach,
    steer,
)
from omninav.stages.simulator.world import World

ROBOT = Robot()


def pillar(
    centre: tuple[float, float] = (5.0, 5.0), half: tuple[float, float] = (0.5, 0.2), yaw: float = 0.0
) -> np.ndarray:
    return np.array([[*centre, math.cos(yaw), math.sin(yaw), *half]])


def hall(*bodies: np.ndarray) -> Obstacles:
    return gather(np.concatenate([np.empty((0, 6)), *bodies]), (10.0, 8.0), reach(ROBOT))


def test_clearance_is_that_of_the_world():
    world = World(DEMO)
    room = gather(box_array(world.obstacles), DEMO.size, 0.6)
    points = np.random.default_rng(0).uniform((0, 0), DEMO.size, (500, 2))
    found = [max(0.0, nearest(room, NO_PEOPLE, x, y)[0]) for x, y in points]
    np.testing.assert_allclose(found, np.minimum(world.clearance(points), 0.6), atol=1e-9)


@pytest.mark.parametrize("yaw", [0.0, 0.7])
def test_the_way_out_leads_straight_away_from_the_nearest_thing(yaw: float):
    room = gather(pillar(yaw=yaw), (10.0, 8.0), 3.0)
    rng = np.random.default_rng(1)
    for x, y in rng.uniform((3.5, 3.5), (6.5, 6.5), (200, 2)):
        distance, away_x, away_y = nearest(room, NO_PEOPLE, x, y)
        further = nearest(room, NO_PEOPLE, x + 1e-4 * away_x, y + 1e-4 * away_y)[0]
        assert further - distance == pytest.approx(1e-4, rel=0.02)


def test_people_are_in_the_way_too():
    distance, away_x, away_y = nearest(hall(), np.array([[2.0, 2.0, 0.3]]), 2.4, 2.0)
    assert (distance, away_x, away_y) == pytest.approx((0.1, 1.0, 0.0))
    assert beam(hall(), np.array([[2.0, 2.0, 0.3]]), 4.0, 2.0, -1.0, 0.0, 4.0) == pytest.approx(1.7)
    assert beam(hall(), np.array([[2.0, 2.0, 0.3]]), 4.0, 2.0, 1.0, 0.0, 4.0) == math.inf


def test_beams_find_what_marching_finds():
    world = World(DEMO)
    room = gather(box_array(world.obstacles), DEMO.size, 0.6)
    rng = np.random.default_rng(2)
    starts = rng.uniform((0, 0), DEMO.size, (400, 2))
    starts = starts[world.clearance(starts) > 0.05][:40]
    steps = np.arange(0.0, 4.0, 0.005)
    for (x, y), azimuth in zip(starts, rng.uniform(0, 2 * math.pi, len(starts)), strict=True):
        dx, dy = math.cos(azimuth), math.sin(azimuth)
        touched = world.clearance(np.stack([x + steps * dx, y + steps * dy], axis=1)) <= 0.0
        marched = steps[np.argmax(touched)] if touched.any() else math.inf
        assert beam(room, NO_PEOPLE, x, y, dx, dy, 4.0) == pytest.approx(marched, abs=0.006) or marched > 3.98


def test_a_ring_hears_the_nearest_thing_in_each_cone_and_nothing_beyond_its_reach():
    ring = Ranges(noise=0.0, dropout=0.0)
    room = gather(pillar((5.0, 4.0), (0.01, 0.01)), (10.0, 8.0), 0.6)
    (heard,) = measure(room, np.zeros((1, 0, 3)), [[3.0, 4.0, 0.0]], ring, np.random.default_rng(0))
    assert heard[8] == pytest.approx(1.99)
    assert np.isinf(heard[[7, 9]]).all()
    (turned,) = measure(room, np.zeros((1, 0, 3)), [[3.0, 4.0, math.pi / 2]], ring, np.random.default_rng(0))
    assert turned[4] == pytest.approx(1.99)  # at its right


def test_noise_and_lost_echoes_of_a_ring_are_as_configured():
    ring = Ranges(noise=0.02, dropout=0.1)
    room = gather(pillar((5.0, 4.0), (1.0, 1.0)), (10.0, 8.0), 0.6)
    heard = measure(room, np.zeros((4000, 0, 3)), np.tile((3.0, 4.0, 0.0), (4000, 1)), ring, np.random.default_rng(0))
    ahead = heard[:, 8]
    assert np.isinf(ahead).mean() == pytest.approx(0.1, abs=0.02)
    assert ahead[np.isfinite(ahead)].std() == pytest.approx(0.02, rel=0.1)


def test_a_robot_driven_at_a_wall_touches_it_once_and_stays_outside():
    state = at_rest((8.0, 4.0, 0.0))
    for _ in range(100):
        steer(state, 0.45, 0.0, limits(ROBOT), 0.1, hall())
    assert state[0] == pytest.approx(10.0 - ROBOT.radius, abs=0.01)
    assert state[COLLISIONS] == 1
    assert state[SPEED] == pytest.approx(0.0, abs=0.01)
    for _ in range(20):
        steer(state, -0.3, 0.0, limits(ROBOT), 0.1, hall())
    assert state[0] < 9.5
    steer(state, 0.45, 0.0, limits(ROBOT), 8.0, hall())
    assert state[COLLISIONS] == 2


@pytest.mark.parametrize(("contact", "moves"), [("slide", True), ("hold", False)])
def test_a_robot_at_an_angle_slides_along_a_wall_or_is_held(contact: str, moves: bool):
    robot = limits(Robot(contact=contact))  # type: ignore[arg-type]
    state = at_rest((9.7, 2.0, math.pi / 4))
    steer(state, 0.45, 0.0, robot, 8.0, hall())
    assert bool(state[1] > 3.0) is moves
    assert state[0] <= 10.0 - ROBOT.radius + 1e-6
    assert state[COLLISIONS] == 1


def test_no_command_ever_brings_a_robot_into_anything():
    """Random commands between two pillars, a wall and a person: never closer than its radius."""
    room, people = hall(pillar(), pillar((5.6, 5.9), (0.2, 0.2), 0.4)), np.array([[4.0, 5.5, 0.3]])
    rng = np.random.default_rng(5)
    state = at_rest((5.0, 4.0, 0.0))
    least = math.inf
    for _ in range(3000):
        steer(state, rng.uniform(-0.6, 0.6), rng.uniform(-1.2, 1.2), limits(ROBOT), 0.2, room, people)
        least = min(least, nearest(room, people, state[0], state[1])[0])
    assert least > ROBOT.radius - 1e-6
    assert state[COLLISIONS] > 5


def test_commands_are_followed_within_the_limits():
    state = at_rest((1.0, 4.0, 0.0))
    steer(state, 5.0, 5.0, limits(ROBOT), 0.5, hall())
    assert state[SPEED] == pytest.approx(0.5 * ROBOT.acceleration)
    steer(state, 5.0, 0.0, limits(ROBOT), 3.0, hall())
    assert state[SPEED] == pytest.approx(ROBOT.speed)
    straight = at_rest((1.0, 4.0, 0.0))
    steer(straight, 0.4, 0.0, limits(ROBOT), 10.0, hall())
    assert straight[DISTANCE] == pytest.approx(0.4 * 10.0 - 0.4**2 / (2 * ROBOT.acceleration), abs=0.005)
    assert straight[HEADING] == 0.0


def test_a_robot_that_was_lifted_and_turned_goes_on_and_its_wheels_know_nothing_of_it():
    line = ((1.0, 2.0), (8.0, 2.0))
    driven = drive(line, ROBOT, 20.0, room=hall(), kidnappings=[Kidnapping(at=5.0, turn=1.0)])
    jump = np.flatnonzero((driven.poses != driven.rolled_to).any(axis=1))
    assert jump.tolist() == [100]
    np.testing.assert_allclose(between(driven.rolled_to[100], driven.poses[100]), [0.0, 0.0, 1.0], atol=1e-12)
    np.testing.assert_allclose(driven.poses[-1, :2], (8.0, 2.0), atol=0.15)


def test_a_kidnapped_robot_goes_on_from_the_nearest_point_of_its_route():
    line = ((1.0, 2.0), (8.0, 2.0), (8.0, 6.0), (1.0, 6.0))
    whole = drive(line, ROBOT, 20.0, room=hall())
    driven = drive(line, ROBOT, 20.0, room=hall(), kidnappings=[Kidnapping(at=5.0, to=(4.0, 6.0, 3.0))])
    np.testing.assert_allclose(driven.poses[100], [4.0, 6.0, 3.0])
    np.testing.assert_allclose(driven.poses[-1, :2], (1.0, 6.0), atol=0.15)
    assert len(driven.times) < 0.5 * len(whole.times)
    steps = np.hypot(*(driven.rolled_to[1:] - driven.poses[:-1])[:, :2].T)
    assert steps.max() <= ROBOT.speed * 0.05 * 1.001


def test_what_happens_at_one_moment_happens_in_its_order_and_what_comes_too_late_does_not():
    line = ((1.0, 2.0), (3.0, 2.0))
    late, one, other = (
        Kidnapping(at=500.0, turn=1.0),
        Kidnapping(at=2.0, to=(2.0, 2.0, 0.0)),
        Kidnapping(at=2.0, turn=-0.5),
    )
    driven = drive(line, ROBOT, 20.0, room=hall(), kidnappings=[late, one, other])
    assert driven.kidnappings == ((40, one), (40, other))
    np.testing.assert_allclose(driven.poses[40], [2.0, 2.0, -0.5])
    assert driven.rolled_to[40, 0] < 1.9


def test_nothing_done_to_a_robot_is_an_event_too():
    driven = drive(((1.0, 2.0), (3.0, 2.0)), ROBOT, 20.0, room=hall(), kidnappings=[Kidnapping(at=1.0)])
    assert [row for row, _ in driven.kidnappings] == [20]
    np.testing.assert_array_equal(driven.poses, driven.rolled_to)

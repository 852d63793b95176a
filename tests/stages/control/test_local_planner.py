"""A disc with ranges among walls, led by the local planner alone."""

import math
from dataclasses import replace

import numpy as np
import pytest

from omninav.pipeline import Context, Tick
from omninav.stages.control.local_grid import cell_at
from omninav.stages.control.local_planner import LocalPlanner, LocalPlannerState
from omninav.stages.geometry.plane.se2 import compose
from omninav.stages.values.homing import HomingVector
from omninav.stages.values.pose import Motion
from omninav.stages.values.scan import Scan

AZIMUTHS = -math.pi + np.radians(5.0) * np.arange(72)
CTX = Context("local_planner")
LOST = HomingVector(0, 0.0, 0.0, 1.0, 1.0, 1.0, None, 0, "lost", "it may be anywhere")


def scan_from(pose: np.ndarray, walls: np.ndarray) -> Scan:
    """Ranges to walls (W, 2, 2), each from one point to another, up to 4 m."""
    ranges = np.full(72, np.inf)
    for k, azimuth in enumerate(AZIMUTHS + pose[2]):
        along = np.array([math.cos(azimuth), math.sin(azimuth)])
        for one, other in walls:
            system = np.column_stack([along, one - other])
            if abs(np.linalg.det(system)) > 1e-9:
                metres, part = np.linalg.solve(system, one - pose[:2])
                if 0.0 < metres < min(4.0, ranges[k]) and 0.0 <= part <= 1.0:
                    ranges[k] = metres
    return Scan(ranges, -math.pi, math.radians(5.0), 0.05, 4.0)


class Robot:
    """The planner, and a robot that goes where it is led, 10 cm a tick."""

    def __init__(self, *walls: tuple[tuple[float, float], tuple[float, float]]) -> None:
        self.planner, self.state, self.walls = LocalPlanner(), LocalPlannerState(), np.array(walls, np.float64)
        self.pose, self.motion, self.ticks, self.path = np.zeros(3), None, 0, [np.zeros(2)]

    def look(self, vector: HomingVector | None) -> LocalPlanner.Out:
        tick = Tick(self.ticks, self.ticks * 200_000_000)
        self.ticks += 1
        return self.planner.step(CTX, self.state, tick, scan_from(self.pose, self.walls), self.motion, vector)

    def go(self, turn: float, metres: float) -> None:
        self.motion = Motion(metres * math.cos(turn), metres * math.sin(turn), turn)
        self.pose = compose(self.pose, (self.motion.x, self.motion.y, turn))
        self.path.append(self.pose[:2])

    def vector_to(self, x: float, y: float) -> HomingVector:
        dx, dy = (x, y) - self.pose[:2]
        direction = math.atan2(dy, dx) - self.pose[2]
        return replace(LOST, direction=direction, metres=math.hypot(dx, dy), state="tracking", why="")


def test_a_free_way_is_left_as_it_is() -> None:
    robot = Robot(((-1.0, 1.0), (3.0, 1.0)))
    said = robot.vector_to(2.0, 0.0)
    assert robot.look(said).vector is said


@pytest.mark.parametrize("metres", [0.03, 0.05])
def test_it_goes_straight_to_a_target_that_is_close_beside_a_wall(metres: float) -> None:
    robot = Robot(((-1.0, 0.22), (1.0, 0.22)))
    vector = robot.look(robot.vector_to(metres, 0.0)).vector
    assert vector is not None
    assert vector.direction == pytest.approx(0.0, abs=math.radians(5.0))


def test_what_stands_at_the_edge_of_the_grid_is_not_in_the_way_of_what_lies_beyond() -> None:
    robot = Robot()
    robot.state.evidence.flat[cell_at(np.array([5.95, 5.55]))] = 1.0  # the straight way leaves the grid at 6, 3
    said = robot.vector_to(20.0, 10.0)
    assert robot.look(said).vector is said


def test_it_leads_out_of_a_dead_end_to_what_lies_behind_it() -> None:
    robot = Robot(((1.0, -1.0), (1.0, 1.0)), ((1.0, 1.0), (-1.0, 1.0)), ((1.0, -1.0), (-1.0, -1.0)))
    for _ in range(100):
        vector = robot.look(robot.vector_to(2.0, 0.0)).vector
        assert vector is not None
        assert vector.metres is not None
        if math.dist(robot.pose[:2], (2.0, 0.0)) < 0.2:
            break
        robot.go(vector.direction, 0.1)
    assert robot.pose[:2] == pytest.approx([2.0, 0.0], abs=0.2)
    gaps = [np.abs(np.array(robot.path) - wall).max(axis=1).min() for wall in ((1.0, 1.0), (1.0, -1.0))]
    assert min(gaps) > 0.2
    assert min(point[0] for point in robot.path) < -1.0


def test_a_lost_robot_searches_slowly_behind_the_opening_that_it_sees() -> None:
    room = ((-2.0, -2.0), (2.0, -2.0)), ((2.0, -2.0), (2.0, 2.0)), ((2.0, 2.0), (-2.0, 2.0)), ((-2.0, 2.0), (-2.0, 0.5))
    robot = Robot(*room, ((-2.0, -0.5), (-2.0, -2.0)))
    for _ in range(400):
        command = robot.look(LOST).search
        assert command is not None
        assert command.speed == (0.15 if abs(command.turning) <= 1.5 * math.radians(30.0) else 0.0)
        robot.go(0.2 * command.turning, 0.2 * command.speed)
        if robot.pose[0] < -2.5:
            break
    assert robot.pose[0] < -2.5
    path = np.array(robot.path)
    assert np.hypot(*(path[:, None] - [(-2.0, 0.5), (-2.0, -0.5)]).transpose(2, 0, 1)).min() > 0.25  # its radius


def test_where_all_is_seen_it_searches_no_more() -> None:
    robot = Robot(((-1, -1), (1, -1)), ((1, -1), (1, 1)), ((1, 1), (-1, 1)), ((-1, 1), (-1, -1)))
    assert [robot.look(LOST).search for _ in range(5)][-1] is None


def test_a_robot_that_gets_lost_forgets_what_stood_around_it() -> None:
    robot = Robot(((1.0, -3.0), (1.0, 3.0)))
    led = robot.look(robot.vector_to(2.0, 0.0)).vector
    assert led is not None
    assert abs(led.direction) > 0.5
    assert led.metres == pytest.approx(2.0 * (2.4 + 2.0**0.5), abs=0.2)  # along and across cells, 0.4 m beside its end
    robot.walls = np.zeros((0, 2, 2))
    robot.look(LOST)
    said = robot.vector_to(2.0, 0.0)
    assert robot.look(said).vector is said


def test_without_ranges_it_only_passes_the_vector_on() -> None:
    out = LocalPlanner().step(CTX, LocalPlannerState(), Tick(0, 0), None, None, LOST)
    assert out.vector is LOST
    assert out.search is None


def test_a_robot_that_has_been_put_elsewhere_is_led_around_nothing_of_before() -> None:
    robot = Robot(((1.0, -1.0), (1.0, 1.0)))
    said = robot.vector_to(3.0, 0.0)
    assert robot.look(said).vector is not said
    again = robot.planner.step(
        CTX, robot.state, Tick(1, 0, 1, 0, True), scan_from(np.zeros(3), np.array([])), None, said
    )
    assert again.vector is said


def test_where_motion_is_that_between_images_the_robot_moves_by_that_of_each_tick() -> None:
    state, one, both = LocalPlannerState(), Motion(0.1, 0.0, 0.0), Motion(0.2, 0.0, 0.0)
    for motion in (None, both):  # no image came with the first
        LocalPlanner().step(CTX, state, Tick(0, 0), None, motion, tick_motion=one)
    assert state.pose.tolist() == [0.2, 0.0, 0.0]


@pytest.mark.parametrize(
    ("before", "after"),
    [((1.67, -0.27), (-0.03, 0.03)), ((-0.27, 1.62), (0.03, 0.02)), ((1.42, -1.42), (1.42, -1.42))],
)
def test_the_grid_moves_by_whole_cells_with_a_robot_that_leaves_its_middle(
    before: tuple[float, float], after: tuple[float, float]
) -> None:
    state, wall = LocalPlannerState(pose=np.array([*before, 0.5])), np.array([0.35, 0.95])
    state.evidence.flat[cell_at(wall)] = 1.0
    LocalPlanner().step(CTX, state, Tick(0, 0))
    assert state.pose == pytest.approx((*after, 0.5))
    assert np.flatnonzero(state.evidence).tolist() == [cell_at(wall + np.subtract(after, before))]

"""The watchdog alone, and under the stage that commands the robot."""

import threading

from omninav.pipeline import Context, Tick
from omninav.stages.live.publish import Publish
from omninav.stages.live.watchdog import MIN_TIMEOUT_S, Watchdog
from omninav.stages.values.command import Command

from .conftest import Wire, until


class Robot:
    """Counts how often it was stopped."""

    def __init__(self) -> None:
        self.stops, self.stopped = 0, threading.Event()

    def stop(self) -> None:
        self.stops += 1
        self.stopped.set()


def test_a_robot_that_is_fed_in_time_is_not_stopped_and_one_that_is_not_is_stopped_again_and_again(now: list[float]):
    robot = Robot()
    dog = Watchdog(robot.stop)
    for _ in range(10):
        dog.feed(1.0)
        now[0] += 0.9
        assert not robot.stopped.wait(0.02)
    dog.feed(0.0)  # never less than MIN_TIMEOUT_S
    now[0] += 0.9 * MIN_TIMEOUT_S
    assert not robot.stopped.wait(2 * MIN_TIMEOUT_S)
    for stops in (1, 2, 3):
        now[0] += 1.1 * MIN_TIMEOUT_S
        until(lambda wanted=stops: robot.stops == wanted)
    dog.close()


def test_a_robot_that_stands_is_left_alone_and_is_stopped_once_more_at_the_end(now: list[float]):
    robot = Robot()
    dog = Watchdog(robot.stop)
    dog.feed(0.0)
    dog.rest()
    now[0] += 10.0
    assert not robot.stopped.wait(2 * MIN_TIMEOUT_S)
    dog.close()
    assert robot.stops == 1


def test_a_camera_that_falls_silent_while_the_robot_drives_stops_it(wire: Wire, now: list[float]):
    stage, ctx = Publish(command_type="Twist"), Context("publish")
    stage.setup(ctx)
    for number in range(3):  # ten ticks a second, and then no more
        stage.step(ctx, Tick(number, 10**18 + number * 100_000_000), command=Command(0.3, 0.1))
    assert [message.linear.x for message in wire.on("/cmd_vel")] == [0.3] * 3
    now[0] += 10.0
    until(lambda: len(wire.on("/cmd_vel")) > 3)
    assert {(message.linear.x, message.angular.z) for message in wire.on("/cmd_vel")[3:]} == {(0.0, 0.0)}
    for farewell in wire.farewells:
        farewell()

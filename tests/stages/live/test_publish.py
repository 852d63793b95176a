"""What a live run tells: the graph's own estimate, and map -> odom."""

import math
from collections.abc import Callable

import numpy as np
import pytest
from conftest import TOUR

from omninav.pipeline import Context, Tick
from omninav.pipeline.api.run import Run
from omninav.pipeline.mcap.message_types import standard_types
from omninav.stages.geometry.plane.se2 import between, compose
from omninav.stages.live.publish import Publish
from omninav.stages.values.belief import PoseEstimate
from omninav.stages.values.command import Command
from omninav.stages.values.confidence import TRACKING_STATES, PoseConfidence
from omninav.stages.values.planned_route import PlannedRoute
from omninav.stages.values.pose import Pose

from .conftest import ODOMETRY, Recorded, Wire, decode

RESET_AT, RESET = 41, (20.0, -10.0, 0.7)
"""Messages of odometry before it begins anew, and the robot's pose (m, rad) in the old frame by then."""


def stamp_of(message) -> int:
    return message.header.stamp.sec * 10**9 + message.header.stamp.nanosec


def planar(at, turned) -> np.ndarray:
    """x, y, heading of a message's position and rotation."""
    return np.array([at.x, at.y, 2 * math.atan2(turned.z, turned.w)])


class Driven(Recorded):
    """A recorded robot whose odometry, when told so, begins anew, at zero, in the middle of the drive."""

    def __init__(self, begins_anew: bool) -> None:
        super().__init__()
        self.begins_anew, self.reported = begins_anew, dict[int, np.ndarray]()

    def take(self, timeout_s=0.0):
        message = super().take(timeout_s)
        if message is None or message.topic != ODOMETRY:
            return message
        decoded = decode(message.msgtype, message.data)
        at, turned = decoded.pose.pose.position, decoded.pose.pose.orientation
        pose = planar(at, turned)
        if self.begins_anew and len(self.reported) >= RESET_AT:
            pose = between(RESET, pose)
            at.x, at.y = pose[:2].tolist()
            turned.z, turned.w = math.sin(pose[2] / 2), math.cos(pose[2] / 2)
        self.reported[stamp_of(decoded)] = pose
        return message._replace(data=bytes(standard_types().serialize_cdr(decoded, message.msgtype)))


@pytest.mark.parametrize("tolerance_s", [0.0, 0.3])
def test_map_to_odom_is_the_estimate_over_the_odometry_dated_ahead(wire: Wire, tolerance_s: float):
    stage, ctx = Publish(tf_tolerance_s=tolerance_s), Context("publish")
    stage.setup(ctx)
    estimate = PoseEstimate(Pose(3.0, 1.0, math.pi / 2), np.eye(3), 0.8, Pose(7.0, 7.0, 0.0))
    stage.step(ctx, Tick(0, 5_000_000_000), estimate=estimate, odometry=Pose(1.0, 2.0, math.pi))
    (transform,) = wire.on("/tf")[0].transforms
    assert stamp_of(transform) == 5_000_000_000 + round(tolerance_s * 1e9)
    assert (transform.header.frame_id, transform.child_frame_id) == ("map", "odom")
    # by hand: a robot at (1, 2) that looks back is at (3, 1) and looks left, so that odometry's x axis lies along -y
    at = transform.transform
    assert planar(at.translation, at.rotation) == pytest.approx([1.0, 2.0, -math.pi / 2])
    pose = wire.on("/estimate/pose")[0].pose.pose
    assert (pose.position.x, pose.position.y) == (3.0, 1.0)


@pytest.mark.parametrize(("unsure", "published"), [(False, ["tracking", "blind"]), (True, list(TRACKING_STATES))])
def test_a_robot_that_searches_or_is_lost_publishes_no_pose_unless_it_is_asked_to(
    wire: Wire, unsure: bool, published: list[str]
):
    estimate = PoseEstimate(Pose(3.0, 1.0, 0.0), np.eye(3), 0.8, Pose(3.0, 1.0, 0.0))
    stage, ctx, told = Publish(unsure=unsure), Context("publish"), []
    stage.setup(ctx)
    for n, state in enumerate(TRACKING_STATES):
        wire.sent.clear()
        confidence = PoseConfidence(0.7 if state in ("tracking", "blind") else 0.2, state)
        stage.step(ctx, Tick(n, n * 10**9), estimate, Pose(1.0, 2.0, 0.0), confidence=confidence)
        assert len(wire.on("/estimate/pose")) == len(wire.on("/tf"))
        told += [state] * len(wire.on("/tf"))
        assert wire.status.troubles.get("state", "tracking") == state
    assert sorted(told) == sorted(published)


def test_why_a_goal_was_given_up_is_noted_until_the_next_one(wire: Wire):
    stage, ctx = Publish(), Context("publish")
    stage.setup(ctx)
    for state, why in (("gave up", "no path leads to the goal"), ("under way", "")):
        stage.step(ctx, Tick(0, 0), route=PlannedRoute(np.zeros(0, np.int64), state, 0, why))
        assert wire.status.troubles.get("route", "") == (why and f"the goal was given up: {why}")


def test_no_command_exceeds_the_limits_of_the_robot_whatever_its_controller_asks_for(wire: Wire):
    stage, ctx = Publish(command_type="Twist", max_speed=0.3, max_angular_speed=0.5), Context("publish")
    stage.setup(ctx)
    for speed, turning in ((0.2, -0.4), (300.0, -2.0), (-1.0, 0.0)):
        stage.step(ctx, Tick(0, 0), command=Command(speed, turning))
    sent = [(message.linear.x, message.angular.z) for message in wire.on("/cmd_vel")]
    assert sent == [(0.2, -0.4), (0.3, -0.5), (-0.3, 0.0)]
    assert ctx.counts["limited_command"] == 2
    for farewell in wire.farewells:
        farewell()


@pytest.mark.parametrize(("taken", "begins_anew"), [("mode", False), ("mean", False), ("mode", True)])
def test_a_robot_publishes_the_pose_that_its_variant_is_measured_by_over_what_odometry_reports_now(
    localised: Callable[..., Run], taken: str, begins_anew: bool
):
    robot = Driven(begins_anew)
    settings = (f"tour={TOUR}", "nodes.prior.number=300", "nodes.source.seconds=9", "nodes.publish.unsure=true")
    settings += (f"nodes.belief_estimate.taken={taken}", "nodes.publish.tf_tolerance_s=0.3")
    frames = localised(robot, "omniview_mcl", *settings).frames
    poses, transforms = robot.on("/estimate/pose"), [one.transforms[0] for one in robot.on("/tf")]
    assert len(poses) == len(transforms) == len(frames) >= 5
    where = np.array([(pose.pose.pose.position.x, pose.pose.pose.position.y) for pose in poses])
    assert where == pytest.approx(columns(frames, "estimate_x", "estimate_y"), abs=1e-6)
    assert [pose.pose.covariance[0] for pose in poses] == pytest.approx(frames["covariance_xx"].to_numpy(), rel=1e-3)
    assert (np.hypot(*(where - columns(frames, "mean_x", "mean_y")).T).max() > 0.01) == (taken == "mode")
    stamps, reported = np.array(list(robot.reported)), np.array(list(robot.reported.values()))
    after = 0
    for pose, transform, estimate in zip(poses, transforms, where, strict=True):
        stamp = stamp_of(pose)
        assert stamp_of(transform) == stamp + 300_000_000
        since_s = (stamp - stamps[RESET_AT]) / 1e9
        if begins_anew and -1.0 <= since_s <= 0.0:  # an image may be of before, and its correction of after
            continue
        after += since_s > 0.0
        # whoever looks up map -> odom and then the robot's own odom -> base_link finds the estimate
        correction = planar(transform.transform.translation, transform.transform.rotation)
        x, y = (np.interp(stamp, stamps, reported[:, axis]) for axis in (0, 1))
        assert compose(correction, (x, y, 0.0))[:2] == pytest.approx(estimate, abs=0.01)
    assert after >= 3


def columns(frames, *names: str) -> np.ndarray:
    return np.column_stack([frames[name].to_numpy() for name in names])

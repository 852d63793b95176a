"""What a live run tells: the graph's own estimate, and map -> odom."""

import csv
import math
from pathlib import Path

import numpy as np
import pytest
from conftest import DRIVE, TOUR

import omninav
from omninav.pipeline import Context, Tick
from omninav.pipeline.mcap.message_types import standard_types
from omninav.pipeline.mcap.reader import LogReader
from omninav.stages.geometry.plane.se2 import between, compose
from omninav.stages.live import live_source as live
from omninav.stages.live import publish
from omninav.stages.live.publish import Publish
from omninav.stages.live.transport import Arrival
from omninav.stages.values.belief import PoseEstimate
from omninav.stages.values.confidence import TRACKING_STATES, PoseConfidence
from omninav.stages.values.pose import Pose

from .conftest import ROOT, Wire, decode
from .test_live_map import Recorded

CAMERA = ROOT / "tests/data/camera.yaml"


def heading(rotation) -> float:
    return 2 * math.atan2(rotation.z, rotation.w)


def stamp_of(message) -> int:
    return message.header.stamp.sec * 10**9 + message.header.stamp.nanosec


@pytest.mark.parametrize("tolerance_s", [0.0, 0.3])
def test_map_to_odom_is_the_estimate_over_the_odometry_dated_ahead(monkeypatch: pytest.MonkeyPatch, tolerance_s: float):
    wire = Wire()
    wire.status.live = True
    monkeypatch.setattr(publish, "connect", lambda name, domain: wire)
    stage, ctx = Publish(tf_tolerance_s=tolerance_s), Context("publish")
    stage.setup(ctx)
    mean = Pose(7.0, 7.0, 0.0)
    estimate = PoseEstimate(Pose(3.0, 1.0, math.pi / 2), np.eye(3), 0.8, mean)
    stage.step(ctx, Tick(0, 5_000_000_000), estimate=estimate, odometry=Pose(1.0, 2.0, math.pi))
    (transform,) = wire.on("/tf")[0].transforms
    assert stamp_of(transform) == 5_000_000_000 + round(tolerance_s * 1e9)
    assert (transform.header.frame_id, transform.child_frame_id) == ("map", "odom")
    # by hand: a robot at (1, 2) that looks back is at (3, 1) and looks left, so that odometry's x axis lies along -y
    at = transform.transform
    assert (at.translation.x, at.translation.y) == pytest.approx((1.0, 2.0))
    assert heading(at.rotation) == pytest.approx(-math.pi / 2)
    pose = wire.on("/estimate/pose")[0].pose.pose
    assert (pose.position.x, pose.position.y) == (3.0, 1.0)


def test_a_robot_that_searches_or_is_lost_publishes_no_pose_unless_it_is_asked_to(monkeypatch: pytest.MonkeyPatch):
    estimate = PoseEstimate(Pose(3.0, 1.0, 0.0), np.eye(3), 0.8, Pose(3.0, 1.0, 0.0))
    for unsure, published in ((False, ["tracking", "blind"]), (True, list(TRACKING_STATES))):
        wire = Wire()
        wire.status.live = True
        monkeypatch.setattr(publish, "connect", lambda name, domain, wire=wire: wire)
        stage, ctx, told = Publish(unsure=unsure), Context("publish"), []
        stage.setup(ctx)
        for n, state in enumerate(TRACKING_STATES):
            confidence = PoseConfidence(0.7 if state in ("tracking", "blind") else 0.2, state)
            before = len(wire.on("/estimate/pose")), len(wire.on("/tf"))
            stage.step(ctx, Tick(n, n * 10**9), estimate, Pose(1.0, 2.0, 0.0), confidence=confidence)
            after = len(wire.on("/estimate/pose")), len(wire.on("/tf"))
            assert after in (before, (before[0] + 1, before[1] + 1))
            told += [state] if after != before else []
            assert wire.status.troubles.get("state", "tracking") == state
        assert sorted(told) == sorted(published)


@pytest.mark.parametrize("taken", ["mode", "mean"])
def test_a_robot_publishes_the_pose_that_its_variant_is_measured_by(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, shared_cache: Path, taken: str
):
    robot = Recorded()
    for module in (live, publish):
        monkeypatch.setattr(module, "connect", lambda name, domain: robot)
    monkeypatch.setattr(live, "disconnect", lambda: None)
    settings = ["source=live", "publish=ros2", "log=live", "nodes.source.seconds=8"]
    settings += [
        f"nodes.belief_estimate.taken={taken}",
        "nodes.publish.unsure=true",
        "nodes.publish.tf_tolerance_s=0.3",
        "nodes.prior.number=300",
    ]
    words = {"camera": CAMERA, "cache": shared_cache, "progress": False, "plots": "none", "tour": TOUR}
    run = omninav.run("omniview_mcl", *settings, folder=tmp_path / "run", **words)
    with (run.folder / "frames.csv").open() as file:
        rows = list(csv.DictReader(file))
    poses, transforms = robot.on("/estimate/pose"), [one.transforms[0] for one in robot.on("/tf")]
    assert len(poses) == len(transforms) == len(rows) >= 5
    told = list(LogReader(DRIVE).messages({"/odom"}))
    seconds, odom = [each.stamp / 1e9 for each in told], [each.content.pose.pose.position for each in told]
    apart = []
    for row, pose, transform in zip(rows, poses, transforms, strict=True):
        where = [pose.pose.pose.position.x, pose.pose.pose.position.y]
        assert where == pytest.approx([float(row["estimate_x"]), float(row["estimate_y"])], abs=1e-6)
        assert pose.pose.covariance[0] == pytest.approx(float(row["covariance_xx"]), rel=1e-3)
        assert stamp_of(transform) == stamp_of(pose) + 300_000_000
        at, turn = transform.transform.translation, heading(transform.transform.rotation)
        x, y = (np.interp(stamp_of(pose) / 1e9, seconds, [getattr(each, axis) for each in odom]) for axis in "xy")
        # whoever looks up map -> odom and then the robot's own odom -> base_link finds the estimate
        ahead = [at.x + math.cos(turn) * x - math.sin(turn) * y, at.y + math.sin(turn) * x + math.cos(turn) * y]
        assert ahead == pytest.approx(where, abs=0.01)
        apart.append(math.dist(where, [float(row["mean_x"]), float(row["mean_y"])]))
    assert (max(apart) > 0.01) == (taken == "mode")


RESET = (20.0, -10.0, 0.7)
"""A pose (m, rad) of the robot in its odometry's old frame, at which a new one begins."""


class Restarted(Recorded):
    """A robot whose odometry begins anew, at zero, in the middle of the drive."""

    def __init__(self) -> None:
        super().__init__()
        self.reported: dict[int, np.ndarray] = {}

    def take(self, timeout_s: float = 0.0) -> Arrival | None:
        arrival = super().take(timeout_s)
        if arrival is None or arrival.topic != "/odom":
            return arrival
        message = decode(arrival.msgtype, arrival.data)
        at, turned = message.pose.pose.position, message.pose.pose.orientation
        pose = np.array([at.x, at.y, heading(turned)])
        if len(self.reported) > 40:
            pose = between(RESET, pose)
            at.x, at.y = pose[:2].tolist()
            turned.z, turned.w = math.sin(pose[2] / 2), math.cos(pose[2] / 2)
        self.reported[stamp_of(message)] = pose
        return arrival._replace(data=bytes(standard_types().serialize_cdr(message, arrival.msgtype)))


def test_after_odometry_began_anew_map_to_odom_is_over_what_the_robot_reports_now(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, shared_cache: Path
):
    robot = Restarted()
    for module in (live, publish):
        monkeypatch.setattr(module, "connect", lambda name, domain: robot)
    monkeypatch.setattr(live, "disconnect", lambda: None)
    settings = ["source=live", "publish=ros2", "log=live", "nodes.source.seconds=9", "nodes.prior.number=300"]
    settings += ["nodes.publish.unsure=true"]
    words = {"camera": CAMERA, "cache": shared_cache, "progress": False, "plots": "none", "tour": TOUR}
    omninav.run("omniview_mcl", *settings, folder=tmp_path / "run", **words)
    stamps = np.array(list(robot.reported))
    reset, poses = stamps[41], np.array(list(robot.reported.values()))
    after = 0
    for pose, transform in zip(robot.on("/estimate/pose"), robot.on("/tf"), strict=True):
        stamp = stamp_of(pose)
        correction = transform.transforms[0].transform
        at = np.array([correction.translation.x, correction.translation.y, heading(correction.rotation)])
        reported = poses[np.abs(stamps - stamp).argmin()]
        estimate = pose.pose.pose.position
        if stamp < reset - 10**9 or stamp > reset:
            assert compose(at, reported)[:2] == pytest.approx([estimate.x, estimate.y], abs=0.05)
        after += stamp > reset
    assert after >= 3

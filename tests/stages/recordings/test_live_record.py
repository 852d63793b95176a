"""Messages of a live run, as they come and as a recording."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from made_logs import IMAGE, ODOMETRY, START, TRUTH, Made, messages, picture, pose_fields, write_mcap

from omninav.pipeline.mcap.message_types import make_message
from omninav.stages.recordings.live_record import HEADER, HEADER_TYPE, LiveHeader, OdometryBuffer, Role
from omninav.stages.recordings.opening import open_recording
from omninav.stages.recordings.recording import Recording

from .conftest import refused

TYPES = {
    "odometry": "nav_msgs/msg/Odometry",
    "scan": "sensor_msgs/msg/LaserScan",
    "initial_pose": "geometry_msgs/msg/PoseWithCovarianceStamped",
    "transforms": "tf2_msgs/msg/TFMessage",
    "goal": "geometry_msgs/msg/PoseStamped",
}


def say(drive: OdometryBuffer, role: Role, seconds: float, fields: dict[str, Any]) -> list[Any]:
    message = make_message(TYPES[role], fields)
    return drive.add(role, round(seconds * 1e9), message, f"{role} at {seconds} s")


def test_a_live_record_gives_what_a_log_of_the_same_messages_does(tmp_path: Path, whole: Recording) -> None:
    header = LiveHeader({IMAGE: "image", ODOMETRY: "odometry", TRUTH: "truth"})
    first = Made(HEADER, HEADER_TYPE, START, START, make_message(HEADER_TYPE, {"data": header.text()}))
    late = sorted(messages(), key=lambda made: made.stamp + 40_000_000 * (made.topic == IMAGE))
    record = open_recording(str(write_mcap(tmp_path / "live.mcap", iter([first, *late]))))
    for name in ("stamps", "odometry", "truth", "unmeasured_s2"):
        np.testing.assert_allclose(getattr(record, name), getattr(whole, name), atol=1e-9)
    np.testing.assert_array_equal(record.image(3), picture(3))
    with refused("has made no tick"):  # of images that lie in it before what follows them
        open_recording(str(write_mcap(tmp_path / "early.mcap", iter([first, *messages()]))))


def test_a_scan_is_turned_by_the_transforms_that_came_before_its_tick() -> None:
    drive = OdometryBuffer(LiveHeader({"/odom": "odometry", "/tf_static": "transforms"}))
    for at in (0.0, 1.0):
        say(drive, "odometry", at, {"child_frame_id": "body", "pose": {"pose": pose_fields(at, 0.0, 0.0)}})
    fields = {"header": {"frame_id": "laser"}, "ranges": [1.0, 2.0], "angle_increment": 0.1, "range_max": 4.0}
    say(drive, "scan", 0.2, fields)
    assert drive.frame(300_000_000)[0].scan.first == 0.0
    turned = {"translation": {}, "rotation": {"z": 1.0, "w": 0.0}}
    link = {"header": {"frame_id": "body"}, "child_frame_id": "laser", "transform": turned}
    assert say(drive, "transforms", 0.3, {"transforms": [link]}) == ["transforms at 0.3 s"]
    assert drive.frame(400_000_000)[0].scan.first == pytest.approx(np.pi)


def test_a_tick_has_what_lies_before_it_and_each_wish_once() -> None:
    drive = OdometryBuffer(LiveHeader({"/odom": "odometry", "/truth": "truth"}))
    for at in (0.0, 1.0, 2.0):
        assert say(drive, "odometry", at, {"pose": {"pose": pose_fields(at, 0.0, 0.0)}}) == [f"odometry at {at} s"]
    assert not say(drive, "scan", 0.2, {"ranges": [1.0, 2.0], "angle_increment": 0.1, "range_max": 4.0})
    covariance = np.zeros(36)
    covariance[[0, 7, 35]] = 0.09, 0.41, 0.04  # of x and y the mean counts: 0.25
    say(drive, "initial_pose", 0.3, {"pose": {"pose": pose_fields(1.5, 2.5, 0.3), "covariance": covariance}})
    say(drive, "goal", 0.4, {"pose": pose_fields(3.0, -1.0, 0.0)})
    asked, _ = drive.frame(199_999_999)
    assert (asked.scan, asked.unmeasured_s2, asked.restart.at) == (None, 0.0, pytest.approx((1.5, 2.5, 0.3, 0.5, 0.2)))
    assert (asked.goal.x, asked.goal.y, np.isnan(asked.truth).tolist()) == (3.0, -1.0, [True] * 3)
    for at, ranges, used in ((0.5, [1.0, 2.0], ["scan at 0.2 s"]), (1.2, [1.0, 2.0], []), (1.200000001, None, [])):
        tick, items = drive.frame(round(at * 1e9))  # readings are of a second, and once in the record
        assert (tick.scan and tick.scan.ranges.tolist(), items, tick.restart, tick.goal) == (ranges, used, None, None)
        assert tick.odometry.tolist() == tick.reported_odometry.tolist() == [pytest.approx(at), 0.0, 0.0]
    assert drive.frame(2_000_000_001) is None
    for at in (2.1, 3.1):  # a counter that was reset
        say(drive, "odometry", at, {"pose": {"pose": pose_fields(at - 102.1, 0.0, 0.0)}})
    tick, _ = drive.frame(2_600_000_000)
    assert (tick.odometry[0], tick.reported_odometry[0], tick.unmeasured_s2) == pytest.approx((2.6, -99.5, 0.01))
    for variance in (-0.04, np.nan, np.inf, 1e300):
        covariance[35] = variance
        with pytest.raises(ValueError, match="covariance"):
            say(drive, "initial_pose", 0.3, {"pose": {"pose": pose_fields(0.0, 0.0, 0.0), "covariance": covariance}})

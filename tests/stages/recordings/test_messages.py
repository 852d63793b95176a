"""Messages as they come from a scanner, sound ones and others."""

import math
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from omninav.pipeline.mcap.message_types import make_message
from omninav.stages.recordings.messages import ImpossiblePose, pose_of, scan_of

SOUND = {"angle_min": -math.pi, "angle_increment": math.radians(1.0), "range_min": 0.05, "range_max": 4.0}


def scan(ranges: list[float], **fields: float) -> object:
    content = {**SOUND, **fields, "ranges": np.array(ranges, np.float32)}
    return make_message("sensor_msgs/msg/LaserScan", content, 0)


def test_what_is_no_number_or_out_of_its_bounds_is_no_echo() -> None:
    found = scan_of(scan([0.5, 4.0, math.nan, 0.25, 5.0], range_min=0.5, angle_increment=-6.25))
    assert found.ranges.tolist() == [0.5, 4.0, math.inf, math.inf, math.inf]
    assert (found.first, found.step, found.nearest, found.farthest) == (np.float32(-math.pi), -6.25, 0.5, 4.0)


def test_a_pose_has_the_heading_of_a_robot_that_is_tilted_and_is_on_earth() -> None:
    rotation = dict(zip("xyzw", Rotation.from_euler("ZYX", [2.0, 0.3, -0.2]).as_quat(), strict=True))

    def posed(x: float, length: float) -> tuple[float, float, float]:
        orientation = {axis: length * number for axis, number in rotation.items()}
        fields = {"pose": {"position": {"x": x, "y": -3.0}, "orientation": orientation}}
        return pose_of(make_message("geometry_msgs/msg/PoseStamped", fields))

    for x, length in ((9.9e7, 1.0), (4.0, 0.51), (4.0, 1.99)):
        assert posed(x, length) == pytest.approx((x, -3.0, 2.0))
    for x, length in ((1.01e8, 1.0), (4.0, 0.49), (4.0, 2.01)):
        with pytest.raises(ImpossiblePose):
            posed(x, length)


@pytest.mark.parametrize(
    "fields",
    [
        *({"angle_increment": step} for step in (0.0, 1e-12, -1e-12, 7.0, math.nan, math.inf)),
        *({"angle_min": first} for first in (math.nan, -math.inf)),
        *({"range_max": most} for most in (math.nan, math.inf, 0.01)),
        *({"range_min": least} for least in (math.nan, -1.0)),
        *({"ranges": few} for few in ([], [1.0])),
    ],
    ids=str,
)
def test_angles_bounds_and_numbers_of_ranges_that_no_scanner_has_are_refused(fields: dict[str, Any]) -> None:
    with pytest.raises(ValueError, match=r"no scan|its ranges go"):
        scan_of(scan(**{"ranges": [1.0, 2.0], **fields}))

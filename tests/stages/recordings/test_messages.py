"""Messages as they come from a scanner, sound ones and others."""

import math

import numpy as np
import pytest

from omninav.pipeline.mcap.message_types import make_message
from omninav.stages.recordings.messages import scan_of

SOUND = {"angle_min": -math.pi, "angle_increment": math.radians(1.0), "range_min": 0.05, "range_max": 4.0}


def scan(ranges: list[float], **fields: float) -> object:
    content = {**SOUND, **fields, "ranges": np.array(ranges, np.float32)}
    return make_message("sensor_msgs/msg/LaserScan", content, 0)


def test_what_is_no_number_or_out_of_its_bounds_is_no_echo() -> None:
    assert scan_of(scan([1.0, math.nan, 0.01, 5.0])).ranges.tolist() == [1.0, math.inf, math.inf, math.inf]
    assert scan_of(scan([1.0, 2.0], angle_increment=-0.01)).step == pytest.approx(-0.01)


@pytest.mark.parametrize("ranges", [[], [1.0]])
def test_a_scan_without_two_ranges_is_refused(ranges: list[float]) -> None:
    with pytest.raises(ValueError, match="are no scan"):
        scan_of(scan(ranges))


@pytest.mark.parametrize(
    "fields",
    [
        *({"angle_increment": step} for step in (0.0, 1e-12, -1e-12, 7.0, math.nan, math.inf)),
        *({"angle_min": first} for first in (math.nan, -math.inf)),
        *({"range_max": most} for most in (math.nan, math.inf, 0.01)),
        *({"range_min": least} for least in (math.nan, -1.0)),
    ],
    ids=str,
)
def test_angles_and_bounds_that_no_scanner_has_are_refused(fields: dict[str, float]) -> None:
    with pytest.raises(ValueError, match=r"no scan|its ranges go"):
        scan_of(scan([1.0, 2.0], **fields))

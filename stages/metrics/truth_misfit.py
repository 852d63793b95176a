"""Tells a truth in another frame or unit from an estimate that is wrong."""

import math
from collections.abc import Mapping

import numpy as np

from omninav.stages.geometry.arrays import Array
from omninav.stages.geometry.plane.pose_errors import heading_errors_deg, position_errors
from omninav.stages.geometry.plane.se2 import between
from omninav.stages.geometry.plane.track_fit import track_fit
from omninav.stages.values.confidence import SURE_STATES, TRACKING_STATES
from omninav.stages.values.drive import Drive, known

from .map_frame import in_map_frame

OFF_M, OFF_DEG = 0.3, 30.0
"""Median errors of a position and of a heading, beyond which the truth is examined."""
MAX_LATE, LATE_GAIN = 10, 4.0
"""Most images by which the truth may be late or early, and how many times smaller the median error must be then."""
ALIGNED_DEG = 5.0
"""Median error of headings up to which a truth may be that of another point of the robot (degrees)."""
FAR_M = 1.0
"""Median error beyond which a truth that fits under no change is reported (m)."""
MIN_CONSTANT = 0.9
"""Mean cosine above which headings are one, or differ by a constant angle."""
MIN_MOVED, MIN_PAIRS, MIN_SHARE = 1.0, 40, 0.6
"""Distance (m) that a pair of images must have moved, and fewest such pairs and the share of them that must agree on
one relation of the tracks."""
OTHER_UNIT, OTHER_HEADING = 0.4, math.radians(20.0)
"""Relations of scale (octaves) and of headings (rad) beyond which unit or headings differ."""


def truth_misfit(drive: Drive) -> str:
    """Describes the change with which a drive's truth fits the estimates of a sure robot, or that none does.

    "" where it needs none.
    """
    rows = known(drive.truth) & known(drive.estimate)
    truth, estimate, seconds = drive.truth[rows], drive.estimate[rows], drive.seconds[rows]
    sure = [TRACKING_STATES[each] in SURE_STATES for each in drive.state[rows & (drive.state >= 0)]]
    if 2 * sum(sure) < len(sure) or not sure:  # a robot that is lost may follow odometry at another place
        return ""
    off_m = float(np.median(position_errors(estimate, truth)))
    off_deg = float(np.median(heading_errors_deg(estimate, truth)))
    if off_m < OFF_M and off_deg < OFF_DEG:
        return ""
    turns = abs(np.exp(1j * truth[:, 2]).mean()) < MIN_CONSTANT
    if not turns and np.ptp(truth[:, :2], axis=0).max() < MIN_MOVED:
        return ""  # of a robot that stands still any wrong estimate fits under any of the changes
    left = _left_late(truth, estimate)
    found = (
        (_mounted(truth, estimate, off_m, left) if off_deg < ALIGNED_DEG and turns else "")
        or _late(seconds, off_m, left)
        or (_turned(truth, estimate) if off_m < OFF_M else _moved(truth, estimate))
    )
    if found:
        return f"the estimates fit the truth only once that is {found}; errors are of the truth as given"
    if off_m < FAR_M:
        return ""
    return (
        "the truth fits the estimates of a sure robot under no shift in time, turn, mirror, scale or move: check that "
        "it is of this drive, and its columns"
    )


def _mounted(truth: Array, estimate: Array, off_m: float, left_late: Mapping[int, float]) -> str:
    """The truth of another point of the robot, or a camera that was moved on it: off by the same in its own frame."""
    away = between(truth, estimate)[:, :2]
    middle = np.median(away, axis=0)
    left = float(np.median(np.hypot(*(away - middle).T)))
    if left * LATE_GAIN > off_m or left * 2.0 > min(left_late.values(), default=math.inf):
        return ""  # a robot that always drives as fast is ahead by the same where its truth is late
    return (
        f"{middle[0]:+.2f} m forward and {middle[1]:+.2f} m to the left on the robot: check which point it is of, and "
        "where the camera sits (`position` in camera.yaml)"
    )


def _late(seconds: Array, off_m: float, left: Mapping[int, float]) -> str:
    if not left or min(left.values()) * LATE_GAIN > off_m:
        return ""
    shift = min(left, key=left.__getitem__)
    apart = float(np.median(np.subtract(*_shifted(seconds, seconds, shift))))
    return f"{abs(apart):.2g} s {'earlier' if apart < 0 else 'later'}: check that both are stamped by one clock"


def _left_late(truth: Array, estimate: Array) -> dict[int, float]:
    """Median errors (m) with a truth that is taken so many images later."""
    most = min(MAX_LATE, len(truth) // 4)
    shifts = (shift for shift in range(-most, most + 1) if shift)
    return {shift: float(np.median(position_errors(*_shifted(estimate, truth, shift)))) for shift in shifts}


def _shifted(one: Array, other: Array, by: int) -> tuple[Array, Array]:
    return (one[by:], other[:-by]) if by > 0 else (one[:by], other[-by:])


def _turned(truth: Array, estimate: Array) -> str:
    for sign in (1.0, -1.0):
        constant = np.exp(1j * (estimate[:, 2] - sign * truth[:, 2])).mean()
        if abs(constant) > MIN_CONSTANT and sign > 0.0:
            return f"turned by {math.degrees(np.angle(constant)):+.0f} degrees: check that heading 0 is along x"
        if abs(constant) > MIN_CONSTANT:
            return "turned the other way: check that headings grow counter-clockwise, from 0 along x"
    return ""


def _moved(truth: Array, estimate: Array) -> str:
    fit = track_fit(truth, estimate, MIN_MOVED)
    if fit is None or fit.pairs < MIN_PAIRS or fit.share < MIN_SHARE:
        return ""
    if fit.mirrored:
        return "mirrored: check the signs of y and heading (counter-clockwise is positive)"
    if abs(math.log2(fit.scale)) > OTHER_UNIT:
        return f"multiplied by {fit.scale:.3g}: check its unit (m)"
    if abs(fit.angle) > OTHER_HEADING:
        return f"turned in place by {math.degrees(-fit.angle):+.0f} degrees: check that heading 0 is along x"
    moved = float(np.median(position_errors(in_map_frame(truth, estimate), truth)))
    return f"moved by {moved:.2f} m, as in another frame than the map's" if moved > OFF_M else ""

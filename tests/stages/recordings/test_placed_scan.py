"""Ranges of a scanner that does not sit in the robot's middle, looking ahead."""

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from omninav.stages.recordings.placed_scan import placed_scan
from omninav.stages.values.scan import Scan

STEP = math.radians(1.0)


def pose(x: float, y: float, yaw: float, roll: float = 0.0) -> np.ndarray:
    found = np.eye(4)
    found[:3, :3] = Rotation.from_euler("ZYX", [yaw, 0.0, roll]).as_matrix()
    found[:2, 3] = x, y
    return found


def wall_around(x: float, y: float, yaw: float, side: float, first: float, beams: int) -> Scan:
    """A scan from within a round wall of 2 m about the robot's middle."""
    azimuths = yaw + side * (first + STEP * np.arange(beams))
    along = x * np.cos(azimuths) + y * np.sin(azimuths)
    return Scan(np.sqrt(along**2 + 4.0 - x * x - y * y) - along, first, STEP, 0.1, 8.0)


@pytest.mark.parametrize("yaw", [0.0, 2.5])
@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_turned_scanner_and_one_upside_down_keep_their_beams(yaw: float, side: float) -> None:
    scan = Scan(np.array([1.0, 2.0, math.inf]), 0.3, STEP, 0.1, 8.0)
    found = placed_scan(scan, pose(0.0, 0.0, yaw, 0.0 if side > 0 else math.pi))
    assert found.ranges.tolist() == scan.ranges.tolist()
    assert found.azimuths() == pytest.approx(yaw + side * scan.azimuths())


@pytest.mark.parametrize("at", [(0.6, 0.0, math.pi, 1.0), (-0.3, 0.5, 1.0, -1.0)])
def test_a_scanner_beside_the_middle_sees_a_round_wall_as_the_middle_does(at: tuple[float, ...]) -> None:
    x, y, yaw, side = at
    found = placed_scan(wall_around(*at, -math.pi, 360), pose(x, y, yaw, 0.0 if side > 0 else math.pi))
    assert len(found.ranges) == 360
    assert found.ranges == pytest.approx(2.0, abs=1e-9)
    ahead = placed_scan(wall_around(*at, -math.pi / 4, 91), pose(x, y, yaw, 0.0 if side > 0 else math.pi))
    ends = yaw + side * np.array([-math.pi / 4, math.pi / 4])
    reach = wall_around(*at, -math.pi / 4, 91).ranges[[0, -1]]
    seen = np.arctan2(y + reach * np.sin(ends), x + reach * np.cos(ends))
    off = np.exp(1j * ahead.azimuths()[[0, -1]]) - np.exp(1j * seen[:: round(side)])
    assert np.abs(off).max() < STEP  # what it does not see is in no beam


def test_a_wall_that_is_nearer_to_the_middle_than_to_the_scanner_has_no_holes() -> None:
    azimuths = -math.pi + STEP * np.arange(360)
    corridor = np.minimum(0.5 / np.abs(np.sin(azimuths) + 1e-12), 9.0)
    found = placed_scan(
        Scan(np.where(corridor < 8.0, corridor, math.inf), -math.pi, STEP, 0.1, 8.0), pose(0.3, 0.0, 0.0)
    )
    beside = np.abs(np.sin(found.azimuths())) > 0.3
    assert np.isfinite(found.ranges[beside]).all()
    assert np.abs(found.ranges[beside] * np.sin(found.azimuths()[beside])).max() < 0.55


def test_the_nearest_of_echoes_in_one_direction_counts_and_silence_reaches_less_far() -> None:
    ranges = np.full(360, math.inf)
    ranges[180], ranges[0] = 0.5, 0.6  # straight on, and behind it
    found = placed_scan(Scan(ranges, -math.pi, STEP, 0.1, 8.0), pose(1.0, 0.0, 0.0))
    heard = np.flatnonzero(np.isfinite(found.ranges))
    assert found.ranges[heard].tolist() == pytest.approx([0.4])
    assert math.cos(found.azimuths()[heard[0]]) == pytest.approx(1.0, abs=1e-3)
    assert (found.nearest, found.farthest) == (0.0, 7.0)


def test_a_scan_without_a_pose_or_of_a_scanner_that_leans_stays_as_it_is() -> None:
    scan = Scan(np.array([1.0, 2.0]), 0.3, STEP, 0.1, 8.0)
    assert placed_scan(scan, None) is scan
    assert placed_scan(scan, pose(0.3, 0.0, 1.0, math.radians(30.0))) is scan

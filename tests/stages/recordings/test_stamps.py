"""Poses at the images' times."""

from types import SimpleNamespace

import numpy as np
import pytest

from omninav.stages.recordings.clock_changes import camera_clock_set, set_back
from omninav.stages.recordings.stamps import lone, poses_near

SECOND = 10**9
TIMES = 1_700_000_000 * SECOND + np.array([0, 1, 4]) * SECOND
POSES = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [4.0, 0.0, 0.0]])


def known(seconds: list[float], max_gap_s: float) -> list[float | None]:
    stamps = TIMES[0] + (np.array(seconds) * SECOND).astype(np.int64)
    found = poses_near(TIMES, POSES, stamps, max_gap_s)[:, 0]
    return [None if np.isnan(x) else round(float(x), 9) for x in found]


def test_a_pose_counts_where_the_nearer_of_its_neighbours_is_near_enough() -> None:
    assert known([0.2, 0.8, 1.2, 3.8], 0.3) == [0.2, 0.8, 1.2, 3.8]
    assert known([0.4, 0.6, 2.5, 1.4, 3.6], 0.3) == [None] * 5


def test_before_the_first_and_after_the_last_pose_nothing_is_known() -> None:
    assert known([-0.1, 0.0, 4.0, 4.1], 0.3) == [None, 0.0, 4.0, None]


def test_rounding_puts_no_stamp_before_the_first_or_after_the_last_pose() -> None:
    assert known([-4e-8, 4 + 4e-8, 4.0005], 0.3) == [0.0, 4.0, 4.0]
    assert known([-0.002, 4.002], 0.3) == [None, None]
    assert known([4.0005], 1e-4) == [None]


def test_a_stamp_is_alone_more_than_an_hour_from_all_others_unless_that_is_common() -> None:
    hour = 3600 * SECOND
    assert lone(np.array([0, 1, hour + 2, 2 * hour + 3, 2 * hour + 4])).tolist() == [False, False, True, False, False]
    assert lone(np.array([0, hour + 1, hour + 2])).tolist() == [True, False, False]
    for stamps in ([0, 1, hour + 1, 2 * hour + 2, 2 * hour + 3], [0, hour + 1], [0, hour + 1, hour + 2, 2 * hour + 3]):
        assert not lone(np.array(stamps)).any()


def test_a_clock_is_said_to_be_set_back_by_ten_seconds_or_more() -> None:
    records = [SimpleNamespace(log_time=at) for at in (0, 30 * SECOND, 20 * SECOND, 40 * SECOND)]
    assert set_back(records).startswith("the clock was set back by 10 s after image 2;")
    records[2].log_time += 1
    assert set_back(records) == set_back(records[:1]) == ""


def times(count: int, every_s: float, late_s: float) -> np.ndarray:
    """Stamps and log times (ns) of messages that are recorded late, with jitter."""
    stamps = TIMES[0] + (np.arange(count) * every_s * SECOND).astype(np.int64)
    delays = late_s + np.random.default_rng(count).exponential(0.05, count)
    return np.column_stack((stamps, stamps + (delays * SECOND).astype(np.int64)))


@pytest.mark.parametrize(("by_s", "what"), [(-1.5, "1.5 s slow"), (0.8, "0.8 s fast"), (0.3, ""), (0.0, "")])
def test_a_camera_s_clock_that_is_set_is_told(by_s: float, what: str) -> None:
    images, odometry = times(80, 0.5, 0.1), times(800, 0.05, 0.0)
    images[40:, 0] += round(by_s * SECOND)
    told = camera_clock_set(images, odometry)
    assert told == "" if not what else (told.startswith("from image 40 on") and what in told)


def test_images_that_queue_and_clocks_that_are_set_together_are_no_change_of_the_camera_s() -> None:
    images, odometry = times(80, 0.5, 0.1), times(800, 0.05, 0.0)
    queued, together = images.copy(), odometry.copy()
    queued[40:, 1] += 2 * SECOND
    assert camera_clock_set(queued, odometry) == ""
    images[40:, 0] += 2 * SECOND
    together[400:, 0] += 2 * SECOND
    assert camera_clock_set(images, together) == ""
    assert camera_clock_set(images, odometry)
    assert camera_clock_set(images[38:42], odometry) == camera_clock_set(images, odometry[:3]) == ""

"""Right from the first time on that it was; and where the belief's mean lies at first."""

import math

import numpy as np
import pytest
from measured_drives import AT_ORIGIN, figures, made_drive

from omninav.stages.metrics.initial_mean import InitialMean
from omninav.stages.metrics.tracking_success import TrackingSuccess
from omninav.stages.values.belief import PoseEstimate
from omninav.stages.values.drive import Drive
from omninav.stages.values.grid import FreeSpace
from omninav.stages.values.pose import Pose


def believed(*off: tuple[float, float]) -> Drive:
    """A robot at the origin that is believed `off` (m aside, degrees) in each frame, with means twice as far aside."""
    estimates = [
        PoseEstimate(Pose(0.0, aside, math.radians(turned)), np.eye(3), 1.0, Pose(0.0, 2 * aside, 0.0))
        for aside, turned in off
    ]
    return made_drive([AT_ORIGIN] * len(off), estimates=estimates)


@pytest.mark.parametrize(
    ("off", "after", "share"),
    [
        pytest.param(
            [(9.0, 0.0), (1.0, 40.0), (1.9, 34.5), (2.1, 0.0), (0.0, 0.0), (0.0, 36.0)],
            2, 2 / 4, id="frames before the first right one do not count",
        ),
        pytest.param([(9.0, 0.0), (1.0, 40.0)], None, None, id="never right"),
    ],
)  # fmt: skip
def test_a_robot_is_judged_from_the_first_right_frame_on(off, after, share) -> None:
    assert figures(TrackingSuccess(), believed(*off)) == {
        "tracking_success": {"after_frames": after, "right_rate": share}
    }


def test_an_estimate_at_the_limits_is_right(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("omninav.stages.metrics.success_rate.WITHIN_DEG", 90.0)
    found = figures(TrackingSuccess(), believed((2.0, 90.0), (2.0, -91.0)))
    assert found["tracking_success"] == {"after_frames": 0, "right_rate": 0.5}


def test_frames_without_truth_are_not_judged_and_those_without_estimate_are_not_right() -> None:
    drive = believed((0.0, 0.0), (9.0, 0.0), (0.0, 0.0), (0.0, 0.0))
    drive.truth[0] = np.nan
    drive.estimate[3] = np.nan
    assert figures(TrackingSuccess(), drive)["tracking_success"] == {"after_frames": 2, "right_rate": 0.5}
    drive.truth[:] = np.nan
    assert figures(TrackingSuccess(), drive) is None


def test_the_first_mean_that_there_is_counts_from_the_middle_of_the_free_cells() -> None:
    free = FreeSpace(np.array([[0.0, 0.0], [6.0, 0.0], [0.0, 9.0]]), 1.0)  # their mean is (2, 3)
    drive = believed((0.0, 0.0), (3.5, 0.0), (0.0, 0.0))
    drive.mean[0] = np.nan
    assert figures(InitialMean(), drive, free)["initial_mean"]["from_middle_m"] == pytest.approx(math.hypot(2.0, 4.0))
    drive.mean[:] = np.nan
    assert figures(InitialMean(), drive, free) is None

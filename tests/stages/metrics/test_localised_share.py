"""Shares within the field's thresholds, and what it takes to be found again."""

import numpy as np
import pytest
from small_run import collected

from omninav.pipeline import Context, Tick
from omninav.stages.metrics.localised_share import LocalisedShare
from omninav.stages.metrics.relative_errors import RelativeErrors
from omninav.stages.values.belief import PoseEstimate
from omninav.stages.values.drive import Drive
from omninav.stages.values.pose import Pose


def driven(errors: list[float], degrees: float = 1.0) -> Drive:
    """A straight drive, half a metre a frame, with estimates that lie so far (m) beside it."""
    truth = [Pose(0.5 * n, 0.0, 0.0) for n in range(len(errors))]
    poses = [Pose(0.5 * n, error, np.radians(degrees)) for n, error in enumerate(errors)]
    estimates = [PoseEstimate(pose, np.eye(3), 1.0, pose) for pose in poses]
    return collected([Tick(n, n * 10**9) for n in range(len(errors))], truth, estimates=estimates)


def test_shares_within_the_thresholds_count_position_and_heading():
    ctx, drive = Context("localised"), driven([0.1, 0.3, 0.4, 3.0, 9.0])
    shares = LocalisedShare().step(ctx, drive).metrics.values["localised"]
    assert (shares["fine"], shares["medium"], shares["coarse"]) == pytest.approx((0.2, 0.6, 0.8))
    turned = LocalisedShare().step(ctx, driven([0.1] * 5, degrees=4.0)).metrics.values["localised"]
    assert (turned["fine"], turned["medium"]) == (0.0, 1.0)


def test_frames_and_metres_until_a_lost_robot_is_found_again():
    errors = [4.0] * 6 + [0.1] * 12 + [5.0] * 2 + [0.2] * 12
    found = LocalisedShare().step(Context("localised"), driven(errors)).metrics.values["relocalisation"]
    assert found == {"times_lost": 2, "frames": 4.0, "metres": 2.0, "never": 0}
    still = LocalisedShare().step(Context("localised"), driven([0.1] * 5 + [3.0] * 20)).metrics.values["relocalisation"]
    assert (still["times_lost"], still["frames"], still["never"]) == (1, None, 1)


def test_an_error_between_a_small_lost_m_and_one_metre_is_not_found_again():
    stage = LocalisedShare(lost_m=0.5)
    found = stage.step(Context("localised"), driven([0.7] * 20 + [0.1] * 12)).metrics.values["relocalisation"]
    assert found == {"times_lost": 1, "frames": 20.0, "metres": 10.0, "never": 0}


def test_trajectory_error_without_alignment_keeps_what_alignment_takes_away():
    found = RelativeErrors().step(Context("errors"), driven([2.0] * 8, degrees=0.0)).metrics.values
    assert found["unaligned_trajectory_error_m"]["rmse"] == pytest.approx(2.0)
    assert found["absolute_trajectory_error_m"]["rmse"] == pytest.approx(0.0, abs=1e-9)

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


def test_thresholds_are_those_of_the_benchmarks_and_their_ends_count():
    def shares(error: float, degrees: float) -> tuple[float, ...]:
        found = LocalisedShare().step(Context("localised"), driven([error], degrees)).metrics.values["localised"]
        return tuple(found.values())

    assert shares(0.25, 1.9) == (1.0, 1.0, 1.0)
    assert shares(0.3125, 1.9) == (0.0, 1.0, 1.0)
    assert shares(0.25, 2.1) == (0.0, 1.0, 1.0)
    assert shares(0.5, 4.9) == (0.0, 1.0, 1.0)
    assert shares(0.5, 5.1) == shares(0.5625, 4.9) == (0.0, 0.0, 1.0)
    assert shares(5.0, 9.9) == (0.0, 0.0, 1.0)
    assert shares(5.0, 10.1) == shares(5.125, 9.9) == (0.0, 0.0, 0.0)


def test_a_robot_is_lost_beyond_two_and_a_half_metres_and_found_below_one():
    def told(error: float, then: float) -> dict:
        stage = LocalisedShare()
        return stage.step(Context("l"), driven([error] * 3 + [then] * 12)).metrics.values["relocalisation"]

    assert told(2.5, 0.5)["times_lost"] == 0
    assert told(2.625, 0.9) == {"times_lost": 1, "frames": 3.0, "metres": 1.5, "never": 0}
    assert told(2.625, 1.1) == {"times_lost": 1, "frames": None, "metres": None, "never": 1}


def test_figures_are_medians_over_the_times_that_it_was_found_again():
    errors = [4.0] * 2 + [0.1] * 12 + [4.0] * 3 + [0.1] * 12 + [4.0] * 10 + [0.1] * 12 + [4.0] * 5
    found = LocalisedShare().step(Context("l"), driven(errors)).metrics.values["relocalisation"]
    assert found == {"times_lost": 4, "frames": 3.0, "metres": 1.5, "never": 1}


def test_frames_without_truth_do_not_count_and_those_without_an_estimate_are_in_no_share():
    drive = driven([0.1, 9.0, 9.0, 0.1, 0.1])
    drive.truth[1] = np.nan
    drive.estimate[2] = np.nan
    found = LocalisedShare().step(Context("l"), drive).metrics.values
    assert (found["localised"]["fine"], found["relocalisation"]["times_lost"]) == (0.75, 0)
    drive.estimate[:] = np.nan
    found = LocalisedShare().step(Context("l"), drive).metrics.values
    assert found == {"localised": {"fine": 0.0, "medium": 0.0, "coarse": 0.0}}
    drive.truth[:] = np.nan
    assert LocalisedShare().step(Context("l"), drive).metrics is None

"""Shares within the field's thresholds, and what it takes to be found again."""

import numpy as np
import pytest
from measured_drives import figures, made_drive, on_x

from omninav.stages.metrics.localised_share import LocalisedShare
from omninav.stages.metrics.relative_errors import RelativeErrors
from omninav.stages.values.drive import Drive


def driven(errors: list[float], degrees: float = 1.0) -> Drive:
    """A straight drive, half a metre a frame, with estimates that lie so far (m) beside it."""
    believed = [(0.5 * n, error, np.radians(degrees)) for n, error in enumerate(errors)]
    return made_drive(on_x(0.5 * n for n in range(len(errors))), believed)


def relocalisation(errors: list[float], **parameters: float) -> dict:
    return figures(LocalisedShare(**parameters), driven(errors))["relocalisation"]


def test_shares_within_the_thresholds_count_all_frames():
    assert figures(LocalisedShare(), driven([0.1, 0.3, 0.4, 3.0, 9.0]))["localised"] == pytest.approx(
        {"fine": 0.2, "medium": 0.6, "coarse": 0.8}
    )


def test_thresholds_are_those_of_the_benchmarks_and_their_ends_count():
    def shares(error: float, degrees: float) -> tuple[float, ...]:
        return tuple(figures(LocalisedShare(), driven([error], degrees))["localised"].values())

    assert shares(0.25, 1.9) == (1.0, 1.0, 1.0)
    assert shares(0.3125, 1.9) == shares(0.25, 2.1) == shares(0.5, 4.9) == (0.0, 1.0, 1.0)
    assert shares(0.5, 5.1) == shares(0.5625, 4.9) == shares(5.0, 9.9) == (0.0, 0.0, 1.0)
    assert shares(5.0, 10.1) == shares(5.125, 9.9) == (0.0, 0.0, 0.0)


@pytest.mark.parametrize(
    ("errors", "times_lost", "frames", "never"),
    [
        pytest.param([4.0] * 6 + [0.1] * 12 + [5.0] * 2 + [0.2] * 12, 2, 4.0, 0, id="lost twice"),
        pytest.param([0.1] * 5 + [3.0] * 20, 1, None, 1, id="never found again"),
        pytest.param(
            [4.0] * 2 + [0.1] * 12 + [4.0] * 3 + [0.1] * 12 + [4.0] * 10 + [0.1] * 12 + [4.0] * 5,
            4, 3.0, 1, id="the median of those that were found again",
        ),
        pytest.param([2.5] * 3 + [0.5] * 12, 0, None, 0, id="at two and a half metres it is not lost"),
        pytest.param([2.625] * 3 + [0.9] * 12, 1, 3.0, 0, id="found below one metre"),
        pytest.param([2.625] * 3 + [1.1] * 12, 1, None, 1, id="not found above one metre"),
    ],
)  # fmt: skip
def test_frames_and_metres_until_a_lost_robot_is_found_again(errors, times_lost, frames, never):
    metres = None if frames is None else 0.5 * frames
    assert relocalisation(errors) == {"times_lost": times_lost, "frames": frames, "metres": metres, "never": never}


def test_an_error_between_a_small_lost_m_and_one_metre_is_not_found_again():
    found = relocalisation([0.7] * 20 + [0.1] * 12, lost_m=0.5)
    assert found == {"times_lost": 1, "frames": 20.0, "metres": 10.0, "never": 0}


def test_trajectory_error_without_alignment_keeps_what_alignment_takes_away():
    found = figures(RelativeErrors(), driven([2.0] * 8, degrees=0.0))
    assert found["unaligned_trajectory_error_m"]["rmse"] == pytest.approx(2.0)
    assert found["absolute_trajectory_error_m"]["rmse"] == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("wrong", [0, 5, 20])
def test_a_robot_that_is_lost_in_silence_is_as_lost_as_with_a_wrong_estimate(wrong: int):
    drive = driven([0.1] * 3 + [9.0] * wrong + [0.1] * (32 - wrong))
    drive.estimate[3 + wrong : 23] = np.nan
    found = figures(LocalisedShare(), drive)["relocalisation"]
    assert found == {"times_lost": 1, "frames": 20.0, "metres": 10.0, "never": 0}


def test_frames_without_truth_do_not_count_and_those_without_an_estimate_are_in_no_share():
    drive = driven([0.1, 9.0, 9.0, 0.1, 0.1])
    drive.truth[1] = np.nan
    drive.estimate[2] = np.nan
    found = figures(LocalisedShare(), drive)
    assert (found["localised"]["fine"], found["relocalisation"]["times_lost"]) == (0.75, 1)
    drive.estimate[:] = np.nan
    found = figures(LocalisedShare(), drive)
    assert found["localised"] == {"fine": 0.0, "medium": 0.0, "coarse": 0.0}
    assert found["relocalisation"] == {"times_lost": 1, "frames": None, "metres": None, "never": 1}
    drive.truth[:] = np.nan
    assert figures(LocalisedShare(), drive) is None

"""Each cause once, over a drive of 60 images at 2 Hz and 0.4 m/s in a map whose length scale is 0.4 m."""

import math

import numpy as np
import pytest

from omninav.stages.metrics.causes import stretches
from omninav.stages.metrics.stretches import Log, in_short

N, LOST = 60, slice(30, 40)


def drive(**changed):
    """The columns of a sound drive along x, with others in images 30 to 39, or as they are given."""
    along, one, zero = 0.2 * np.arange(N), np.ones(N), np.zeros(N)
    columns = {
        "log": np.zeros(N, int), "frame": np.arange(N), "time_s": 0.5 * np.arange(N),
        "estimate_x": along, "estimate_y": zero, "estimate_heading": zero, "estimate_weight": one, "confidence": one,
        "motion_x": 0.2 * one, "motion_y": zero, "motion_turn": zero, "position_error_m": np.nan * one,
        "heading_error_deg": np.nan * one,
        "similarity": 0.9 * one, "nearest_m": 0.2 * one, "nearest_scales": 0.5 * one, "match_away_m": 0.2 * one,
        "match_lead": 1.5 * one, "lead_against": zero, "landmarks": 60 * one, "landmarks_away_m": zero,
        "features": 400 * one, "brightness": 0.5 * one, "contrast": 0.1 * one, "correlation": 0.8 * one,
        "conflict": np.full(N, "", object),
    }  # fmt: skip
    for name, value in changed.items():
        columns[name] = columns[name].copy()
        columns[name][LOST if np.ndim(value) == 0 else slice(None)] = value
    return columns | {"state": np.where(columns["confidence"] >= 0.5, "tracking", "lost").astype(object)}


def found(**changed):
    return [(each.first, each.last, each.state, each.cause) for each in stretches([Log(drive(**changed))], 2.5)]


ALONG = 0.2 * np.arange(N)
FEW = {"landmarks": 0, "landmarks_away_m": math.nan, "confidence": 0.1}
AWAY = (np.arange(N) >= 30) & (np.arange(N) < 40)
JUMPED = ALONG + np.where(np.arange(N) >= 35, 5.0, 0.0)


def test_a_drive_that_is_sure_has_no_stretch():
    assert found() == []
    said = "Sure of the estimate from image 0 to the end (60 images)."
    assert in_short(Log(drive(heading_error_deg=-9.0 * np.ones(N)))) == said
    assert in_short(Log(drive(heading_error_deg=-17.2 * np.ones(N)))).startswith(
        f"{said} By ground truth its heading is off by 17 "
    )
    beside = drive(heading_error_deg=-43.0 * np.ones(N), position_error_m=5.0 * np.ones(N))
    assert in_short(Log(beside)) == said  # by a camera's yaw alone the position would be right


@pytest.mark.parametrize(
    ("changed", "state", "cause"),
    [
        (FEW | {"features": 0, "contrast": 0.001}, "blind", "images without content"),
        (FEW | {"features": 0, "contrast": 0.001, "brightness": 0.01}, "blind", "dark images"),
        ({"correlation": 0.1}, "blind", "images without content"),
        ({"confidence": 0.1, "conflict": "the camera looks off: check yaw"}, "unsure", "inputs that do not fit"),
        (FEW | {"nearest_m": 3.0, "nearest_scales": 7.5, "match_away_m": 9.0}, "unsure", "off the map"),
        (FEW | {"brightness": 0.2}, "unsure", "other light"),
        ({"confidence": 0.1, "landmarks_away_m": 6.0, "match_away_m": 6.0}, "unsure", "images against the estimate"),
        (FEW | {"lead_against": 2.0, "match_away_m": 6.0}, "unsure", "images against the estimate"),
        (FEW, "unsure", "few landmarks"),
        (FEW | {"match_away_m": 6.0, "match_lead": 0.1}, "unsure", "places that look alike"),
        ({"confidence": 0.1}, "unsure", "no cause found"),
        ({"position_error_m": 3.0, "match_lead": 0.1}, "wrong", "places that look alike"),
    ],
)  # fmt: skip
def test_each_cause_is_told_by_what_the_images_say(changed, state, cause):
    assert found(**changed) == [(30, 39, state, cause)]


def test_a_robot_that_is_found_elsewhere_was_carried_or_its_odometry_failed():
    for step, cause in ((0.0, "odometry stood still"), (0.6, "odometry slipped")):
        steps = np.where(AWAY, step, 0.2)
        along = np.where(ALONG < 7.9, np.cumsum(steps) - 0.2, ALONG)  # where odometry leads, until it is found
        assert found(**FEW | {"motion_x": steps, "match_away_m": 2.0, "estimate_x": along}) == [
            (30, 39, "unsure", cause)
        ]
    carried = {"landmarks_away_m": 5.0, "match_away_m": 5.0, "estimate_x": np.where(ALONG < 7.9, ALONG, JUMPED)}
    assert found(confidence=0.1, **carried) == [(30, 39, "unsure", "carried elsewhere")]
    (told,) = stretches([Log(drive(confidence=0.1, **carried))], 2.5)
    assert told.evidence == (
        "image 40 is the first to agree with the estimate again, 5.0 m from where odometry leads from image 29 "
        "(2.2 m in 5.5 s); images up to 32 show the robot 5.0 m from the estimate, but it can have driven only 0.9 m"
    )
    assert told.advice == "check the log for lost images; if it has all of them, the robot was carried"
    half = np.where(AWAY & (np.arange(N) >= 34), 0.1, 1.0)
    first, again = stretches([Log(drive(position_error_m=3.0, confidence=half, **carried))], 2.5)
    assert (first.state, again.state) == ("wrong", "unsure")
    assert again.evidence == "as in images 30 to 33; by ground truth the estimate was off by 3.00 m (median)"
    assert not again.advice
    assert found(estimate_x=JUMPED) == [(35, 35, "jumped", "carried elsewhere")]
    moved = ALONG + np.where(np.arange(N) >= 31, 20.0, 0.0)  # the estimate was there before it was sure
    assert found(confidence=0.1, landmarks_away_m=0.1, estimate_x=moved) == [(30, 39, "unsure", "carried elsewhere")]


def test_before_the_first_sure_estimate_the_robot_is_searched_for():
    sure = np.arange(N) >= 4
    assert found(confidence=1.0 * sure) == [(0, 3, "searching", "first images")]
    assert in_short(Log(drive(confidence=1.0 * sure))) == "Sure of the estimate from image 4 to the end (56 images)."
    never = {"confidence": np.zeros(N), "landmarks_away_m": np.full(N, np.nan), "match_lead": np.full(N, 0.1)}
    assert found(**never, match_away_m=np.full(N, 9.0)) == [(0, N - 1, "searching", "another place")]
    for error, cause in ((9.0, "another place"), (0.9, "places that look alike")):  # metres by ground truth, in the map
        of_truth = never | {"position_error_m": np.full(N, error)}
        assert found(**of_truth, match_away_m=np.full(N, 9.0)) == [(0, N - 1, "searching", cause)]
    assert found(**never) == [(0, N - 1, "searching", "places that look alike")]  # most matches lie at the estimate
    assert in_short(Log(drive(**never))) == "Never sure in 60 images."


def test_evidence_has_its_numbers_and_ground_truth_where_there_is_one():
    (told,) = stretches([Log(drive(**FEW, nearest_m=3.0, nearest_scales=7.5, position_error_m=0.3))], 2.5)
    assert "3.0 m from the nearest image of the map (median), 7.5 of its length scales" in told.evidence
    assert told.evidence.endswith("by ground truth the estimate was off by 0.30 m (median)")
    assert told.metres == pytest.approx(2.0)
    assert (told.start_s, told.end_s) == (15.0, 19.5)


def test_without_evidence_of_images_states_are_told_and_causes_are_not():
    sound = drive(confidence=0.1)
    few = {name: sound[name] for name in (*list(sound)[:12], "state")}
    assert [each.cause for each in stretches([Log(few)], 2.5)] == ["not recorded"]
    assert in_short(Log(few)).endswith(
        "recorded no causes, which only particle filters in a map do (nodes.evidence, as in variant=omninav)."
    )
    slam = {name: column for name, column in few.items() if name not in ("confidence", "state")}
    slam |= {"confident": np.ones(N), "similarity": np.where(AWAY, np.nan, 0.9)}  # references are near at times only
    assert stretches([Log(slam)], 2.5) == []

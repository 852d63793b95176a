"""Limits of what is said of inputs: what lies just below each is not said, and what lies just above it is."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

from omninav.pipeline import Context, Tick
from omninav.stages.geometry.plane.se2 import compose
from omninav.stages.monitor.input_conflicts import (
    COLUMNS,
    WINDOW,
    InputConflicts,
    InputConflictsState,
    Watched,
    blind,
    compare_strips,
    foreign,
    frozen,
    inconsistent,
    judge,
    late,
    leap,
    lies_at,
    pose_now,
    remember,
    tracked,
    turned,
)
from omninav.stages.values.belief import PoseEstimate
from omninav.stages.values.image import Strip
from omninav.stages.values.pose import AssumedMotion, AssumedPose, Motion, Pose

Array = npt.NDArray[np.float64]
Finding = Callable[[Watched, float], str]
SCALE_M = 0.4
STANDS = {"step": 0.0, "seen": 0.1}
"""Rows of a robot whose odometry stands still while its images turn."""


def rows_of(
    number: int = 30,
    step: float = 0.2,
    turn: float = 0.0,
    seen: float = math.nan,
    correlation: float = 0.9,
    same: int = 0,
    seconds: float = 1.0,
) -> Array:
    """Rows of images of a robot that drives `step` metres and turns by `turn` between two; the last are the `same`."""
    rows = np.full((number, COLUMNS), np.nan)
    rows[:, 0] = seconds * np.arange(number)
    rows[:, 1], rows[:, 2], rows[:, 3] = step * np.arange(number), 0.0, turn * np.arange(number)
    rows[:, 8], rows[:, 9], rows[:, 10] = seen, correlation, 0.0
    rows[0, 8:10] = math.nan
    if same:
        rows[-same:, 10] = 1.0
    return rows


def sentence_of_leap(
    number: int = 8,
    after_s: float = 60.0,
    step: float = 0.2,
    usual_s: float = 1.0,
    off: float = 0.0,
    turn: float = 0.0,
    side: float = 0.0,
) -> str:
    """The warning at an image so long after the last, of a robot that drove on and is so far `off` its way."""
    before = rows_of(number, step, seconds=usual_s)
    recent = InputConflictsState(rows=before, stamp=int(before[-1, 0] * 1e9))
    tick = Tick(9, recent.stamp + int(after_s * 1e9), 0, 9, False)
    return leap(recent, tick, Pose(step * number + off, side, turn))


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({}, True),
        ({"number": 7}, False),
        ({"after_s": 29.9}, False),
        ({"after_s": 30.0}, True),
        ({"after_s": 0.0}, False),
        ({"after_s": -0.1}, True),
        ({"usual_s": 2.0, "after_s": 39.9}, False),
        ({"usual_s": 2.0, "after_s": 40.1}, True),
        ({"step": 0.019}, False),
        ({"step": 0.021}, True),
        ({"off": 0.09}, True),
        ({"off": 0.11}, False),
        ({"off": -0.09}, True),
        ({"off": -0.11}, False),
        ({"side": 0.09}, True),
        ({"side": 0.11}, False),
        ({"turn": math.radians(14.0)}, True),
        ({"turn": math.radians(-16.0)}, False),
    ],
    ids=str,
)
def test_a_clock_leaps_where_the_robot_drove_on_as_before(given: dict[str, Any], said: bool) -> None:
    assert bool(sentence_of_leap(**given)) == said


def test_a_leap_is_said_with_what_is_more_than_usual_and_how_the_robot_drove() -> None:
    said = sentence_of_leap(after_s=60.0)
    assert said.startswith(
        "the clock leaps by 59 s at image 9, while odometry drives on, 0.20 m, as in the 1.00 s before"
    )
    recent = InputConflictsState(rows=rows_of(8), stamp=7 * 10**9)
    tick = Tick(9, 67 * 10**9, 0, 9, False)
    assert leap(recent, tick, AssumedPose(1.6, 0.0, 0.0)) == ""
    assert leap(recent, tick, None) == ""


def placed(
    number: int = WINDOW,
    at_estimate: int = 0,
    scale: float = 1.0,
    angle_deg: float = 0.0,
    scattered: bool = False,
    correlation: float = 0.9,
    exact: int = 0,
) -> Watched:
    """Best matches of a robot on a winding way, where it is, `scale` times as far or anywhere; `exact` estimates."""
    rng, rows = np.random.default_rng(3), rows_of(number, correlation=correlation)
    times = 0.1 * np.arange(number)
    way = np.column_stack([6.0 * np.sin(times), 9.0 * np.sin(0.7 * times), np.zeros(number)])
    ahead = np.gradient(way[:, :2], axis=0)
    way[:, 2] = np.unwrap(np.arctan2(ahead[:, 1], ahead[:, 0]))
    matches = way * (scale, scale, 1.0) + (0.0, 0.0, math.radians(angle_deg))
    if scattered:
        matches = rng.uniform((-20.0, -20.0, -3.0), (20.0, 20.0, 3.0), (number, 3))
    rows[:, 1:4], rows[:, 4:7] = way, matches
    rows[:, 7] = np.arange(number) < at_estimate
    rows[:exact, 11:] = way[:exact]
    return Watched(rows)


FORWARD = 0.21 * np.arange(40.0)


@pytest.mark.parametrize("carried", [(30.0, 40.0, 1.0), (-3.0, 4.0, -2.0)])
def test_exact_estimates_of_a_robot_that_was_carried_off_once_go_on_with_odometry(
    carried: tuple[float, float, float],
) -> None:
    rows = rows_of(40, step=0.21)
    rows[:, 11:] = rows[:, 1:4]
    rows[30:, 11:] = compose(np.array(carried), rows[30:, 11:])
    assert inconsistent(Watched(rows), SCALE_M) == ""


@pytest.mark.parametrize(
    ("seen", "said"),
    [
        (FORWARD, ""),
        (1.3 * FORWARD, ""),
        (1.6 * FORWARD, "landmarks place 12 of 12 images"),
        (np.full(40, 3.0), "landmarks place 12 of 12 images"),  # one image, with noise
        (FORWARD[::-1], "landmarks place 12 of 12 images"),
        (FORWARD[[*range(30), *range(10)]], ""),  # it was carried off, once
        (FORWARD[[*range(20), *range(4), *range(4), *range(4), *range(8)]], "landmarks place 4 of 12 images"),
        (np.where(np.arange(40) < 35, np.nan, -FORWARD), ""),  # too few are exact
        (np.where(np.arange(40) < 33, np.nan, -FORWARD), "landmarks place 3 of 3 images"),
    ],
)
def test_exact_estimates_are_inconsistent_with_odometry_where_images_are_of_another_time(
    seen: Array, said: str
) -> None:
    rows = rows_of(40, step=0.21)
    rows[:, 11:] = np.column_stack([seen, seen * 0.0, seen * 0.0])
    assert inconsistent(Watched(rows), SCALE_M)[: len(said) or None] == said
    assert judge(Watched(rows), SCALE_M)[0] == ("inconsistent" if said else "")


@pytest.mark.parametrize(
    ("finding", "given", "said"),
    [
        (frozen, {"same": 2}, ""),
        (frozen, {"same": 3}, "its last 3 images are one and the same"),
        (frozen, {"same": 30}, "its last 30 images are one and the same"),
        (frozen, {"same": 8, "step": 0.06}, ""),  # it moved less than half a metre
        (frozen, {"same": 8, "step": 0.07}, "its last 8 images are one and the same"),
        (frozen, {"same": 8, "step": 0.0, "turn": 0.06}, ""),
        (frozen, {"same": 8, "step": 0.0, "turn": -0.07}, "its last 8 images are one and the same"),
        (frozen, {"same": 8, "step": 0.25, "turn": 0.1}, "odometry drove 2.0 m and turned 46 degrees"),
        (blind, {"number": 15, "correlation": 0.1}, ""),
        (blind, {"number": 16, "correlation": 0.1}, "nothing in common"),
        (blind, {"correlation": 0.149}, "nothing in common"),
        (blind, {"correlation": 0.151}, ""),
        (turned, {**STANDS, "number": 17}, "odometry stands still while the images turn by 92 degrees over 16"),
        (turned, {**STANDS, "number": 16}, ""),  # 86 degrees are too few
        (turned, {**STANDS, "number": 60, "seen": 0.052}, ""),  # below what parallax looks like
        (turned, {**STANDS, "number": 60, "seen": -0.053}, "stands still while the images turn by 179 degrees"),
        (turned, {**STANDS, "correlation": 0.4}, ""),
        (turned, {**STANDS, "correlation": 0.41}, "odometry stands still"),
        (turned, {**STANDS, "step": 1e-5}, "odometry stands still"),
        (turned, {**STANDS, "step": 1e-4}, "odometry's heading does not change (0 degrees over 29 images)"),
        (turned, {"seen": 0.1, "turn": 0.0049}, "odometry's heading does not change (8 degrees over 29 images)"),
        (turned, {"seen": 0.1, "turn": 0.0051}, ""),
        (turned, {"seen": 0.1, "turn": 0.1}, ""),
        (foreign, {}, ""),  # matches follow odometry
        (foreign, {"scattered": True}, f"of {WINDOW} best matches 0 % are at the estimate"),
        (foreign, {"scattered": True, "number": WINDOW - 1}, ""),
        (foreign, {"scattered": True, "at_estimate": 12}, f"best matches {1200 / WINDOW:.0f} % are at the estimate"),
        (foreign, {"scattered": True, "at_estimate": 13}, ""),
        (foreign, {"scattered": True, "exact": 12}, "the images fit no place of the map"),
        (foreign, {"scattered": True, "exact": 13}, ""),  # landmarks find the places
        (tracked, {}, ""),
        (tracked, {"scale": 1.25}, ""),
        (tracked, {"scale": 0.8}, ""),
        (tracked, {"scale": 2.0}, "odometry is about 0.5 times as long"),
        (tracked, {"scale": 0.5}, "odometry is about 2 times as long"),
        (tracked, {"angle_deg": 15.0}, ""),
        (tracked, {"angle_deg": 90.0}, "the camera looks +90 degrees off from where odometry drives"),
        (tracked, {"scale": 2.0, "correlation": 0.98}, ""),  # the best match of a standing robot goes back and forth
        (tracked, {"scale": 2.0, "correlation": 0.96}, "odometry is about 0.5 times as long"),
    ],
)
def test_what_fails_or_leads_elsewhere_is_said_beyond_a_limit(
    finding: Finding, given: dict[str, Any], said: str
) -> None:
    watched = placed(**given) if finding in (foreign, tracked) else Watched(rows_of(**given))
    found = finding(watched, SCALE_M)
    assert said in found
    assert bool(found) == bool(said)


@pytest.mark.parametrize(("to_and_fro", "said"), [(0.208, False), (0.22, True)])
def test_odometry_that_turns_wildly_and_not_with_the_images_is_in_another_unit(to_and_fro: float, said: bool) -> None:
    wild = rows_of(60)
    wild[1:, 8] = np.where(np.arange(59) < 20, 0.1, 0.0)  # 2 rad, a sixth of 12; 4 pi are 12.6
    wild[:, 3] = np.cumsum(to_and_fro * (-1.0) ** np.arange(60))
    found = turned(Watched(wild), SCALE_M)
    assert bool(found) == said
    if said:
        assert "odometry turns by 744 degrees over 59 images, the images by 115 degrees, and not together" in found


def swaying(delay_s: float, gain: float = 1.0, size: float = 1.0) -> Watched:
    """A robot that drives 0.4 m/s and turns to and fro; images show its turns so much later, odometry `gain` times."""

    def headings(times: Array) -> Array:
        return np.asarray(size * (2.0 * np.sin(times / 3.0) + np.sin(times / 1.7)))

    times = 0.5 * np.arange(64)
    rows = np.full((64, COLUMNS), np.nan)
    rows[:, 0], rows[:, 1], rows[:, 2], rows[:, 3] = times, 0.4 * times, 0.0, gain * headings(times)
    rows[1:, 8], rows[1:, 9], rows[:, 10] = np.diff(headings(times - delay_s)), 0.9, 0.0
    return Watched(rows)


@pytest.mark.parametrize(
    ("delay_s", "kind"), [(0.0, ""), (0.2, ""), (0.5, "late"), (-0.5, "late"), (1.0, "late"), (2.0, "misplacing")]
)
def test_late_images_are_said_with_their_delay_and_mislead_where_the_robot_is_elsewhere_by_then(
    delay_s: float, kind: str
) -> None:
    images, driven = swaying(delay_s), 0.4 * abs(delay_s)
    found, sentence = judge(images, SCALE_M)
    assert found == kind
    if kind:
        side = "after" if delay_s > 0 else "before"
        assert f"{abs(delay_s)} s {side} odometry measures them, in which the robot drives {driven:.2f} m" in sentence
        assert late(images, SCALE_M, driven - 0.01)
        assert not late(images, SCALE_M, driven + 0.01)


@pytest.mark.parametrize(("size", "said"), [(0.2, False), (0.22, True)])  # 164 and 187 degrees
def test_a_delay_is_said_once_the_images_have_turned_by_half_a_turn(size: float, said: bool) -> None:
    assert bool(late(swaying(0.5, size=size), SCALE_M)) == said


def test_reversed_turns_are_said_and_are_no_delay() -> None:
    found = turned(swaying(0.0, -1.0), SCALE_M)
    assert found.startswith(
        "the images turn against odometry's turns (correlation -1.00 over 63 images): check whether"
    )
    assert late(swaying(0.0, -1.0), SCALE_M) == ""


@pytest.mark.parametrize(
    ("away", "turn_deg", "lies"),
    [(0.79, 0.0, 1.0), (0.81, 0.0, 0.0), (0.0, 29.0, 1.0), (0.0, -31.0, 0.0), (0.0, 359.0, 1.0)],
)
def test_a_match_lies_at_the_estimate_within_two_length_scales_and_thirty_degrees(
    away: float, turn_deg: float, lies: float
) -> None:
    pose = Pose(1.0, 2.0, 0.5)
    match = np.array([1.0, 2.0 - away, 0.5 + math.radians(turn_deg)])
    assert lies_at(match, PoseEstimate(pose, np.eye(3), 1.0, pose), SCALE_M) == lies
    assert math.isnan(lies_at(match, None, SCALE_M))


def test_headings_are_not_wrapped_and_a_guess_is_not_odometry() -> None:
    before = np.array([0.0, 0.0, 3.0])
    np.testing.assert_allclose(pose_now(before, Pose(1.0, 2.0, -3.0), None), (1.0, 2.0, 2 * math.pi - 3.0))
    np.testing.assert_allclose(pose_now(np.full(3, np.nan), Pose(1.0, 2.0, -3.0), None), (1.0, 2.0, -3.0))
    driven = pose_now(np.array([0.0, 0.0, math.pi / 2]), None, Motion(1.0, 0.0, 3.0))
    np.testing.assert_allclose(driven, (0.0, 1.0, math.pi / 2 + 3.0), atol=1e-12)
    np.testing.assert_allclose(pose_now(np.full(3, np.nan), None, Motion(1.0, 0.5, 0.25)), (1.0, 0.5, 0.25))
    np.testing.assert_array_equal(pose_now(before, None, None), before)
    assert np.isnan(pose_now(before, AssumedPose(1.0, 0.0, 0.0), None)).all()
    assert np.isnan(pose_now(before, None, AssumedMotion(1.0, 0.0, 0.0, 0.5, 0.1))).all()


def test_a_window_of_images_is_remembered_and_its_times_begin_with_another_camera() -> None:
    recent = InputConflictsState(pose=np.array([1.0, 2.0, 3.0]))
    for number in range(WINDOW + 2):
        remember(recent, number * 500_000_000, np.full((2, 8), number, np.float32))
    assert recent.rows.shape == (WINDOW, COLUMNS)
    assert (recent.rows[0, 0], recent.rows[-1, 0]) == (1.0, 0.5 * (WINDOW + 1))
    np.testing.assert_array_equal(recent.rows[-1, 1:4], (1.0, 2.0, 3.0))
    remember(recent, 10**12, np.zeros((2, 16), np.float32))
    assert recent.rows[-1, 0] == 0.0


def test_images_are_compared_with_the_ones_before_and_not_across_cameras() -> None:
    recent, rng = InputConflictsState(pose=np.zeros(3)), np.random.default_rng(0)
    first = rng.random((4, 36)).astype(np.float32)
    for stamp, strip in enumerate((first, first, np.roll(first, 9, axis=1), first[:, ::2], first[:, ::2])):
        remember(recent, stamp * 10**9, strip)
    compare_strips(recent)
    np.testing.assert_array_equal(recent.rows[:, 10], (0.0, 1.0, 0.0, 0.0, 1.0))
    assert np.isnan(recent.rows[[0, 3], 9]).all()
    np.testing.assert_allclose(recent.rows[[1, 2, 4], 9], 1.0, atol=1e-3)
    assert abs(recent.rows[2, 8]) == pytest.approx(math.pi / 2, abs=0.01)
    assert len(recent.strips) == 1


def test_what_covers_half_of_the_images_hides_no_turn() -> None:
    seen = np.random.default_rng(1).uniform(50.0, 200.0, (4, 72)).astype(np.float32)
    strips = np.stack([np.roll(seen, 3 * number, axis=1) for number in range(6)])
    strips[:, :, 36:] = 90.0
    recent = InputConflictsState()
    for stamp, strip in enumerate(strips):
        remember(recent, stamp * 10**9, strip)
    compare_strips(recent)
    np.testing.assert_allclose(recent.rows[1:, 8], recent.rows[1, 8], atol=0.03)
    assert abs(recent.rows[1, 8]) == pytest.approx(math.radians(15.0), abs=0.03)


@pytest.mark.parametrize(("interval_s", "remembered"), [(0.24, 5), (0.25, 9), (0.13, 5), (0.1, 3)])
def test_images_that_come_too_soon_are_not_watched(interval_s: float, remembered: int) -> None:
    ctx, state, watch = Context("conflicts"), InputConflictsState(), InputConflicts()
    for number in range(9):
        ctx.tick = Tick(number, round(number * interval_s * 1e9), 0, number, not number)
        watch.step(ctx, state, Strip(np.zeros((4, 36), np.float32)), Pose(0.1 * number, 0.0, 0.0))
    assert len(state.rows) == remembered

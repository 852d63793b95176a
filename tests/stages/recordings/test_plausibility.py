"""What no robot does: it is dropped and counted, and the track is that of the undamaged log."""

import math
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conflicting_logs import ticks
from made_logs import (
    FRAMES,
    IMAGE,
    ODOMETRY,
    START,
    TRUTH,
    Made,
    compressed,
    encoded,
    messages,
    picture,
    pose_at,
    pose_fields,
    write_mcap,
)

from omninav.pipeline import Context
from omninav.pipeline.mcap.message_types import make_message
from omninav.stages.motion.rotation_translation_rotation import RotationTranslationRotation
from omninav.stages.recordings.opening import open_recording
from omninav.stages.recordings.plausibility import (
    MotionLimits,
    believed,
    possible_between,
    squares_within,
    without_jumps,
)
from omninav.stages.recordings.recording import Recording
from omninav.stages.source.log import LogSource
from omninav.stages.values.pose import BridgedMotion, Motion

from .conftest import refused

Pose = tuple[float, float, float]


def step_of(made: Made) -> int:
    return round((made.stamp - START) / 50_000_000)


def posed(made: Made, pose: Pose, quaternion: dict[str, float] | None = None) -> Made:
    fields: dict[str, Any] = pose_fields(*pose)
    fields |= {"orientation": quaternion} if quaternion is not None else {}
    whole = {"pose": {"pose": fields}} if made.topic == ODOMETRY else {"pose": fields}
    return made._replace(content=make_message(made.msgtype, whole, made.stamp))


def log_with(path: Path, change: Callable[[Made, int], Made], topic: str = ODOMETRY) -> Path:
    return write_mcap(path, messages(lambda made: [change(made, step_of(made)) if made.topic == topic else made]))


def away(steps: Iterable[int], change: Callable[..., Pose], *more: Any) -> Callable[[Made, int], Made]:
    """Changes the poses of some steps: `change` is given the step, x, y and heading."""
    return lambda made, step: posed(made, change(step, *pose_at(step * 0.05)), *more) if step in steps else made


DAMAGES: dict[str, tuple[Callable[[Made, int], Made], dict[str, int]]] = {
    "20 m away": (away([82], lambda *_: (20.0, 0.0, 0.0)), {"impossible_motion": 1}),
    "1e4 m away": (away([82], lambda *_: (1e4, 0.0, 0.0)), {"impossible_motion": 1}),
    "1e30 m away": (away([82], lambda *_: (1e30, 0.0, 0.0)), {"impossible_pose": 1}),
    "1e308 m away": (away([82], lambda *_: (1e308, 0.0, 0.0)), {"impossible_pose": 1}),
    "turned": (away([82], lambda _, x, y, heading: (x, y, heading + 2.0)), {"impossible_motion": 1}),
    "every other": (away(range(61, 100, 2), lambda n, *_: (1e4 * math.sin(n), 0.0, 0.0)), {"impossible_motion": 20}),
    "the first": (away([0], lambda *_: (-7e3, 0.0, 0.0)), {"impossible_motion": 1}),
    "half a second": (away(range(80, 90), lambda _, x, y, heading: (x + 30.0, y, heading)), {"impossible_motion": 10}),
    "quaternion of no length": (away([82], lambda _, *pose: pose, {"w": 0.0}), {"impossible_pose": 1}),
}


@pytest.mark.parametrize("topic", [ODOMETRY, TRUTH])
@pytest.mark.parametrize("damage", DAMAGES)
def test_impossible_poses_are_dropped_and_the_track_is_the_undamaged_one(
    damage: str, topic: str, tmp_path: Path, whole: Recording
) -> None:
    change, counted = DAMAGES[damage]
    recording = open_recording(str(log_with(tmp_path / "log.mcap", change, topic)))
    assert recording.dropped == counted
    assert f"log.mcap: {'' if counted.get('impossible_motion') else 'a message on '}{topic}" in next(
        iter(recording.details.values())
    )
    assert recording.stamps.tolist() == whole.stamps.tolist()
    np.testing.assert_allclose(recording.odometry, whole.odometry, atol=0.005)
    np.testing.assert_allclose(recording.truth, whole.truth, atol=0.005)


def test_odometry_that_is_reset_goes_on_where_it_was(tmp_path: Path, whole: Recording) -> None:
    reset = away(range(100, 201), lambda step, *_: pose_at((step - 100) * 0.05))
    recording = open_recording(str(log_with(tmp_path / "log.mcap", reset)))
    assert recording.dropped == {"odometry_jump": 1}
    assert "/odom at 1700000005.000 s" in recording.details["odometry_jump"]
    np.testing.assert_allclose(recording.odometry, whole.odometry, atol=1e-6)


def test_true_poses_may_jump_as_those_of_a_robot_that_is_carried(tmp_path: Path) -> None:
    carried = away(range(100, 201), lambda _, x, y, heading: (x + 40.0, y, heading))
    recording = open_recording(str(log_with(tmp_path / "log.mcap", carried, TRUTH)))
    assert not recording.dropped
    assert recording.truth[-1, 0] > 40.0


@pytest.mark.parametrize("without", ["", ODOMETRY])
def test_nothing_is_true_in_a_silence_and_while_a_robot_is_carried(without: str, tmp_path: Path) -> None:
    def change(made: Made) -> list[Made]:
        step = step_of(made)
        if made.topic != TRUTH:
            return [] if made.topic == without else [made]
        x, y, heading = pose_at(step * 0.05)
        return [] if 60 < step < 100 else [posed(made, (x + 40.0, y, heading)) if step > 135 else made]

    recording = open_recording(str(write_mcap(tmp_path / "log.mcap", messages(change))))
    lost = {6, 7, 8, 9, 13}  # the last is between two poses of a jump
    if without:
        assert recording.dropped == {"no_position": 5}
        assert len(recording.truth) == FRAMES - 5
    else:
        assert recording.dropped == {"no_truth": 5}
        assert set(np.flatnonzero(np.isnan(recording.truth[:, 0])).tolist()) == lost
        assert (
            "/ground_truth/pose jumps or is silent about the image at 1700000003.267 s" in recording.details["no_truth"]
        )
    assert np.isfinite(open_recording(recording.name, truth_max_gap_s=1.0).truth[7]).all()


def test_the_motion_across_a_gap_is_less_certain(tmp_path: Path) -> None:
    path = log_with(tmp_path / "log.mcap", DAMAGES["1e4 m away"][0])
    ctx = Context("source")
    motions = [out.motion for out in ticks(LogSource(log=str(path)), ctx)]
    assert ctx.counts == {"impossible_motion": 1}
    assert [number for number, motion in enumerate(motions) if isinstance(motion, BridgedMotion)] == [8]
    assert motions[8].unmeasured_s == pytest.approx(0.1)
    model = RotationTranslationRotation()
    plain = model.model(Motion(motions[8].x, motions[8].y, motions[8].turn))
    assert model.model(motions[8]).steps == plain.steps
    assert model.model(motions[8]).sigmas[1] ** 2 == pytest.approx(plain.sigmas[1] ** 2 + 0.05**2)
    assert model.model(motions[8]).sigmas[0] ** 2 == pytest.approx(plain.sigmas[0] ** 2 + 0.05**2 / 2)


@pytest.mark.parametrize("stands", [False, True])
def test_motion_in_a_silence_of_odometry_is_less_certain_unless_the_robot_stood(stands: bool, tmp_path: Path) -> None:
    quiet = range(60, 101)

    def change(made: Made) -> list[Made]:
        step = step_of(made)
        if made.topic != ODOMETRY:
            return [made]
        still = posed(made, pose_at(60 * 0.05)) if stands and step >= 60 else made
        return [] if step in quiet[1:-1] else [still]

    path = write_mcap(tmp_path / "log.mcap", messages(change))
    ctx = Context("source")
    motions = [out.motion for out in ticks(LogSource(log=str(path)), ctx)]
    for stride in (1, 2, 3):  # as uncertain as a gap of 2 s, whatever the camera's rate
        parts = [out.motion for out in ticks(LogSource(log=str(path), stride=stride), Context("source"))]
        squares = sum(motion.unmeasured_s**2 for motion in parts if isinstance(motion, BridgedMotion))
        assert squares == pytest.approx(0.0 if stands else 4.0)
    bridged = [number for number, motion in enumerate(motions) if isinstance(motion, BridgedMotion)]
    assert bridged == ([] if stands else [6, 7, 8, 9, 10])
    assert ctx.counts == ({} if stands else {"odometry_silence": 1})
    if not stands:
        assert "/odom is silent for 2.0 s from 1700000003.000 s on" in ctx.details["odometry_silence"]


def test_a_faster_robot_is_believed_where_its_limits_say_so(tmp_path: Path) -> None:
    fast = away(range(201), lambda step, *_: (step * 0.05 * 20.0, 0.0, 0.0))
    path = str(log_with(tmp_path / "log.mcap", fast))
    with refused(r"believed are 15 m/s .*\(nodes\.source\.limits\); most are like"):
        open_recording(path)
    recording = open_recording(path, limits=MotionLimits(speed=25.0))
    assert not recording.dropped
    np.testing.assert_allclose(np.diff(recording.odometry[:, 0]), 10.0)


@pytest.mark.parametrize(("topic", "kept"), [(ODOMETRY, FRAMES), (IMAGE, FRAMES - 1)])
def test_a_stamp_hours_from_all_others_is_dropped(topic: str, kept: int, tmp_path: Path) -> None:
    late = START + 10 * 3600 * 10**9
    last = max(made.stamp for made in messages() if made.topic == topic)

    def changed(made: Made) -> list[Made]:
        if made.topic != topic or made.stamp != last:
            return [made]
        if topic == IMAGE:
            return [made._replace(stamp=late, content=compressed(late, encoded(picture(FRAMES))))]
        return [posed(made._replace(stamp=late), pose_at(10.0))]

    recording = open_recording(str(write_mcap(tmp_path / "log.mcap", messages(changed))))
    assert recording.dropped["lone_stamp"] == 1
    assert len(recording.stamps) == kept


def test_stretches_are_told_apart_by_hand() -> None:
    seconds = np.array([0.0, 0.5, 1.0, 1.5, 2.0, 2.5, 5.0, 5.5, 6.0, 9.0, 9.5, 10.0])
    x = np.array([0.0, 0.5, 50.0, 1.5, np.nan, 2.5, 90.0, 90.5, 91.0, 3.0, 3.5, 4.0])
    stamps = np.round(seconds * 1e9).astype(np.int64)
    poses = np.column_stack([x, np.zeros(12), np.zeros(12)])
    track = believed(stamps, poses, MotionLimits())
    assert track.rows.tolist() == [0, 1, 3, 5, 6, 7, 8, 9, 10, 11]
    assert track.jumps.tolist() == [4, 7]
    assert (track.gaps / 5e8).round().astype(int).tolist() == [[1, 3], [3, 5], [5, 10], [12, 18]]
    rows = track.rows
    joined = without_jumps(stamps[rows], poses[rows], track.jumps)
    np.testing.assert_allclose(joined[:, 0], [0.0, 0.5, 1.5, 2.5, 3.5, 4.0, 4.5, 5.0, 5.5, 6.0])
    at = np.array([0, 2, 4, 10, 15, 21], np.int64) * 5 * 10**8
    np.testing.assert_allclose(squares_within(track.gaps, at), [0.0, 0.25, 1.25, 8.25, 10.5, 17.25])


def test_a_robot_gets_as_far_as_its_speeds_allow_and_turns_the_shorter_way() -> None:
    for way, turn, seconds, possible in (  # 15 m/s and 4 pi rad/s, over a twentieth of a second or more
        (14.9, 0.0, 1.0, True), (15.1, 0.0, 1.0, False), (0.74, 0.0, 0.01, True), (0.76, 0.0, 0.01, False),
        (0.0, 1.25, 0.1, True), (0.0, 1.27, 0.1, False), (0.0, 0.62, 0.01, True), (0.0, 0.64, 0.01, False),
        (0.0, 2 * math.pi - 0.3, 0.05, True),
    ):  # fmt: skip
        start, end = np.array([1.0, 1.0, 0.5]), np.array([1.0 + 0.6 * way, 1.0 - 0.8 * way, 0.5 + turn])
        assert possible_between(start, end, seconds, MotionLimits()) == possible
        stamps = round(seconds * 1e9) * np.arange(3)  # of three poses, of which the last is far from all
        assert len(believed(stamps, np.stack([start, end, end + 1e4]), MotionLimits()).rows) == 2 * possible


def test_a_pose_that_only_one_lost_message_makes_possible_costs_no_other() -> None:
    stamps = np.arange(200) * 50_000_000
    poses = np.column_stack([0.02 * np.arange(200), np.full(200, 6.0), np.zeros(200)])
    damaged = poses.copy()
    damaged[92] = np.nan
    damaged[93, 1] = 4.6  # 1.4 m aside: near enough to where the robot was 0.1 s ago, and to nothing else
    damaged[140:180] = np.nan  # two seconds, after which it goes on from where it has come to
    rows, jumps, _ = believed(stamps, damaged, MotionLimits())
    assert np.setdiff1d(np.arange(200), rows).tolist() == [92, 93, *range(140, 180)]
    assert not len(jumps)


def test_a_track_of_noise_ends_with_what_can_have_been_driven() -> None:
    rng = np.random.default_rng(3)
    stamps = np.cumsum(rng.integers(10**7, 10**8, 400))
    poses = np.where(rng.random((400, 1)) < 0.7, rng.uniform(-1e3, 1e3, (400, 3)), 0.0)
    limits = MotionLimits()
    rows, jumps, _ = believed(stamps, poses, limits)
    joined = without_jumps(stamps[rows], poses[rows], jumps)
    speeds = np.hypot(*np.diff(joined[:, :2], axis=0).T) / np.maximum(np.diff(stamps[rows]) / 1e9, 0.05)
    assert len(rows) > 80
    assert speeds.max() <= limits.speed

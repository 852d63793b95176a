"""The source stage: ticks, motion over gaps, several logs, made-up odometry, resume."""

import copy
import dataclasses
import math
from itertools import pairwise
from pathlib import Path
from types import SimpleNamespace

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
    messages,
    pose_at,
    pose_fields,
    write_mcap,
)

from omninav.pipeline import Context
from omninav.pipeline.mcap.message_types import make_message
from omninav.stages.camera.equirectangular import Equirectangular
from omninav.stages.camera.model import MODELS
from omninav.stages.geometry.plane.se2 import between, compose
from omninav.stages.recordings.live_record import HEADER, HEADER_TYPE, LiveHeader
from omninav.stages.recordings.opening import open_recording
from omninav.stages.recordings.recording import UnreadableRecording
from omninav.stages.source.log import LogSource, synthetic_increment
from omninav.stages.source.log_parts import LogPart
from omninav.stages.source.playback import PlaybackState
from omninav.stages.values.pose import AssumedMotion


def context(seed: int = 0) -> Context:
    return Context("source", np.random.default_rng(seed))


def drive(
    source: LogSource, ctx: Context | None = None, position: PlaybackState | None = None, most: int = 10**6
) -> list:
    ctx, position, outs = ctx or context(), position or PlaybackState(), []
    source.setup(ctx)
    while len(outs) < most and (out := source.step(ctx, position)) is not None:
        outs.append(out)
    return outs


@pytest.fixture
def log(tmp_path: Path) -> str:
    return str(write_mcap(tmp_path / "log.mcap"))


def row(value) -> np.ndarray:
    return np.array(dataclasses.astuple(value))


def without(*topics: str):
    return messages(lambda made: [] if made.topic in topics else [made])


def assert_motions_chain_to_odometry(outs: list) -> None:
    pose = row(outs[0].odometry)
    for out in outs[1:]:
        pose = compose(pose, row(out.motion))
        np.testing.assert_allclose(pose, row(out.odometry), atol=1e-12)


def test_every_image_is_a_tick_and_motions_chain_to_the_odometry(log: str) -> None:
    ctx = context()
    outs = drive(LogSource(log=log), ctx)
    assert [out.tick.index for out in outs] == [out.tick.frame for out in outs] == list(range(FRAMES))
    assert [out.tick.first_of_log for out in outs] == [True] + [False] * (FRAMES - 1)
    assert outs[0].motion is None
    assert_motions_chain_to_odometry(outs)
    assert ctx.facts["odometry"] == "measured"
    assert not ctx.used_rng


def test_motion_spans_images_that_cannot_be_used(tmp_path: Path) -> None:
    def spoilt(made: Made) -> list[Made]:
        bad = made.topic == IMAGE and round((made.stamp - START) / 5e8 - 0.534) in (0, 4, 5)
        return [made._replace(content=compressed(made.stamp, b"no picture"))] if bad else [made]

    path = str(write_mcap(tmp_path / "log.mcap", messages(spoilt)))
    ctx = context()
    outs = drive(LogSource(log=path), ctx)
    assert [out.tick.frame for out in outs] == [n for n in range(FRAMES) if n not in (0, 4, 5)]
    assert [out.tick.index for out in outs] == list(range(FRAMES - 3))
    assert outs[0].tick.first_of_log
    assert outs[0].motion is None
    odometry = open_recording(path).odometry
    np.testing.assert_allclose(row(outs[3].motion), between(odometry[3], odometry[6]))
    assert ctx.counts == {"undecodable_image": 3}
    assert ctx.warnings[-1].startswith(f"3 of {FRAMES} images could not be used")
    assert "log.mcap: image 0" in ctx.details["undecodable_image"]


def test_several_logs_follow_each_other_with_their_boundaries_marked(log: str) -> None:
    source = LogSource(log=(log, log), first=2, stop=12, stride=3)
    outs = drive(source)
    assert source.length() == len(outs) == 8
    assert [out.tick.log for out in outs] == [0] * 4 + [1] * 4
    assert [out.tick.frame for out in outs] == [2, 5, 8, 11] * 2
    assert [number for number, out in enumerate(outs) if out.tick.first_of_log] == [0, 4]
    assert [number for number, out in enumerate(outs) if out.motion is None] == [0, 4]


@pytest.mark.parametrize("measured", [True, False])
@pytest.mark.parametrize("stop", [1, 7, FRAMES + 1, FRAMES + 9])
def test_a_source_resumed_from_its_state_goes_on_with_the_same_values(
    tmp_path: Path, measured: bool, stop: int
) -> None:
    path = str(write_mcap(tmp_path / "log.mcap", None if measured else without(ODOMETRY)))
    whole = drive(LogSource(log=(path, path)))
    ctx, position = context(), PlaybackState()
    head = drive(LogSource(log=(path, path)), ctx, position, stop)
    later, kept = context(99), PlaybackState(**copy.deepcopy(vars(position)))
    later.rng.bit_generator.state = ctx.rng.bit_generator.state
    tail = drive(LogSource(log=(path, path)), later, kept)
    assert len(head) + len(tail) == len(whole) == 2 * FRAMES
    for one, other in zip(whole, head + tail, strict=True):
        assert dataclasses.astuple(one.tick) == dataclasses.astuple(other.tick)
        assert (one.motion and dataclasses.astuple(one.motion)) == (other.motion and dataclasses.astuple(other.motion))
        assert dataclasses.astuple(one.odometry) == dataclasses.astuple(other.odometry)


def test_without_odometry_it_is_made_up_from_the_truth_and_said(tmp_path: Path) -> None:
    path = str(write_mcap(tmp_path / "log.mcap", without(ODOMETRY)))
    ctx = context(1)
    outs = drive(LogSource(log=path), ctx)
    assert ctx.facts["odometry"] == "synthetic"
    assert ctx.used_rng
    assert row(outs[0].odometry).tolist() == [0.0, 0.0, 0.0]
    assert_motions_chain_to_odometry(outs)
    true = [between(row(a.truth), row(b.truth)) for a, b in pairwise(outs)]
    assert not np.allclose([row(out.motion) for out in outs[1:]], true, atol=1e-3)
    other = drive(LogSource(log=path), context(2))
    assert row(other[-1].odometry)[0] != row(outs[-1].odometry)[0]


def test_without_odometry_and_truth_a_path_is_guessed_for_drawing(tmp_path: Path) -> None:
    ctx = context()
    outs = drive(LogSource(log=str(write_mcap(tmp_path / "log.mcap", without(ODOMETRY, TRUTH)))), ctx)
    assert len(outs) == FRAMES
    assert all(isinstance(out.motion, AssumedMotion) for out in outs[1:])
    assert all(out.truth is None for out in outs)
    assert ctx.facts["odometry"] == "guessed"
    assert "No odometry in" in ctx.warnings[0]


@pytest.mark.parametrize("cuts", [1, 5, 50])
def test_made_up_odometry_has_its_deviations_over_one_metre_however_it_is_cut(cuts: int) -> None:
    random = np.random.default_rng(0)
    step = np.array([1 / cuts, 0, 0])
    steps = [synthetic_increment(step, pair) for pair in random.standard_normal((2000 * cuts, 2))]
    drives = np.array(steps).reshape(2000, cuts, 3)
    lengths, turns = np.hypot(drives[..., 0], drives[..., 1]).sum(axis=1), drives[..., 2].sum(axis=1)
    # 2000 drives know a standard deviation to 1.6 %; noise on 2 cm steps folds a little where a step would go back
    assert np.degrees(np.std(turns)) == pytest.approx(3, rel=0.06)
    if cuts < 50:
        assert np.std(lengths) == pytest.approx(0.1, rel=0.06)


def test_made_up_odometry_errs_with_the_turn_and_not_when_nothing_moves() -> None:
    noise = np.random.default_rng(0).standard_normal((4000, 2))
    still = synthetic_increment(np.zeros(3), noise[0])
    np.testing.assert_array_equal(still, np.zeros(3))
    turns = [synthetic_increment(np.array([0, 0, 1.0]), pair)[2] - 1 for pair in noise]
    assert np.degrees(np.std(turns)) == pytest.approx(3, rel=0.06)


@pytest.mark.parametrize("selection", [{"stride": 2}, {"rate_hz": 0.7}, {"first": 6}])
def test_what_a_live_run_was_asked_reaches_the_next_frame_that_is_used(tmp_path: Path, selection: dict) -> None:
    topics: dict = {IMAGE: "image", ODOMETRY: "odometry", "/initialpose": "initial_pose", "/goal_pose": "goal"}
    first = Made(HEADER, HEADER_TYPE, START, START, make_message(HEADER_TYPE, {"data": LiveHeader(topics).text()}))
    late = sorted(without(TRUTH), key=lambda made: made.stamp + 40_000_000 * (made.topic == IMAGE))
    sixth = [k for k, made in enumerate(late) if made.topic == IMAGE][5]
    for topic, pose in (("/initialpose", "PoseWithCovarianceStamped"), ("/goal_pose", "PoseStamped")):
        fields = {"pose": pose_fields(1.5, 2.5, 0.3)}
        fields = {"pose": {**fields, "covariance": np.eye(6).ravel()}} if topic == "/initialpose" else fields
        kind, at = f"geometry_msgs/msg/{pose}", late[sixth].stamp
        late.insert(sixth, Made(topic, kind, at, at, make_message(kind, fields)))
    record = str(write_mcap(tmp_path / "live.mcap", iter([first, *late])))
    every, some = drive(LogSource(log=record)), drive(LogSource(log=record, **selection))
    assert [out.tick.frame for out in every if out.goal and out.restart.at[:3] == pytest.approx((1.5, 2.5, 0.3))] == [5]
    (asked,) = [out for out in some if out.goal or out.restart]
    assert (asked.tick.frame, asked.goal.x) == (6, 1.5)
    moved = compose(every[5].restart.at[:3], row(every[6].motion))
    assert asked.restart.at == pytest.approx((*moved, *every[5].restart.at[3:]))


def test_a_later_part_of_a_recording_asks_again_for_nothing_that_an_earlier_part_was_asked() -> None:
    source, one, other = LogSource(log="live.mcap"), object(), object()
    source._parts = [SimpleNamespace(recording=each, frames=np.array(rows)) for each, rows in
                     ((one, [2, 5]), (one, [8, 11]), (other, [1, 4]))]  # fmt: skip
    begun, further = [PlaybackState(log=log) for log in range(3)], PlaybackState(log=1, next=1, last=0)
    assert [source._last_used(position) for position in (*begun, further)] == [-1, 5, -1, 8]


def test_a_selection_without_frames_is_refused(log: str) -> None:
    with pytest.raises(UnreadableRecording, match="leaves none of its frames"):
        LogSource(log=log, first=500).setup(context())


def test_what_was_lost_at_opening_is_counted_once(log: str) -> None:
    data = Path(log).read_bytes()
    Path(log).write_bytes(data[: len(data) // 2])
    ctx, source = context(), LogSource(log=log)
    source.inputs_digest()
    outs = drive(source, ctx)
    assert ctx.counts["cut_file"] == 1
    assert log in ctx.details["cut_file"]
    assert len(outs) == source.length()


def test_other_code_of_a_camera_model_of_ones_own_makes_other_results(
    log: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Results kept of a log are not used again once the model's code has changed."""
    mine = type("Mine", (Equirectangular,), {"__module__": __name__, "projection": "mine"})
    monkeypatch.setitem(MODELS, "mine", mine)
    camera = tmp_path / "camera.yaml"
    camera.write_text("{projection: mine, image: {width: 48, height: 16}, column_of_forward: 24}")
    digests = set()
    for code in ("first", "second"):
        monkeypatch.setattr(
            "omninav.stages.source.playback.module_version", lambda module, code=code: f"{module} {code}"
        )
        digests.add(LogSource(log=log, camera=str(camera)).inputs_digest())
    assert len(digests) == 2


def test_a_cut_leaves_the_middle_out_and_odometry_does_not_notice(log: str) -> None:
    whole, carried = drive(LogSource(log=log)), drive(LogSource(log=log, cuts=((3, 6),)))
    assert [out.tick.frame for out in carried] == [0, 1, 2, *range(6, FRAMES)]
    assert [out.tick.first_of_log for out in carried] == [True] + [False] * (FRAMES - 4)
    np.testing.assert_array_equal(row(carried[3].truth), row(whole[6].truth))
    for after_cut, out in zip(carried[3:], whole[6:], strict=True):
        np.testing.assert_allclose(row(after_cut.motion), row(out.motion), atol=1e-12)
    assert_motions_chain_to_odometry(carried)


def test_a_cut_over_hours_is_no_new_log_but_a_pause_is(log: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("omninav.stages.source.log_parts.NEW_LOG_AFTER_S", 1.0)
    assert [out.tick.log for out in drive(LogSource(log=log, cuts=((3, 6),)))] == [0] * (FRAMES - 3)
    monkeypatch.setattr("omninav.stages.source.log_parts.NEW_LOG_AFTER_S", 0.1)
    assert drive(LogSource(log=log))[-1].tick.log == FRAMES - 1


def test_made_up_odometry_does_not_notice_a_splice_either(tmp_path: Path) -> None:
    log = str(write_mcap(tmp_path / "log.mcap", without(ODOMETRY)))
    whole, carried = drive(LogSource(log=log)), drive(LogSource(log=log, cuts=((2, 5),)))
    # the same way, each with its own noise: a cut taken for motion would be as long as three pictures' way
    assert math.hypot(*row(carried[2].motion)[:2]) < 2 * math.hypot(*row(whole[5].motion)[:2])


@pytest.mark.parametrize("cuts", [((0, 5),), ((5, 5),), ((5, 400),), ((3, 6), (4, 8))])
def test_a_cut_that_does_not_lead_onwards_is_refused(log: str, cuts: tuple[tuple[int, int], ...]) -> None:
    with pytest.raises(UnreadableRecording, match="does not lead onwards"):
        drive(LogSource(log=log, cuts=cuts))


def test_a_log_of_which_no_image_can_be_used_is_refused(tmp_path: Path) -> None:
    for number in range(3):
        (tmp_path / f"{number}.png").write_bytes(b"no picture")
    (tmp_path / "camera.yaml").write_text("projection: donut\nimage: {width: 16, height: 16}\n")
    with pytest.raises(UnreadableRecording, match=r"not one of its images can be used \(3 undecodable_image; .*0.png"):
        drive(LogSource(log=str(tmp_path)))


def test_odometry_that_stands_still_while_ground_truth_moves_is_said(tmp_path: Path) -> None:
    def stopped(made: Made) -> Made:
        if made.topic == ODOMETRY:
            made.content.pose.pose = make_message("geometry_msgs/msg/Pose", {"orientation": {"w": 1.0}})
        return made

    ctx = Context("source")
    LogSource(log=str(write_mcap(tmp_path / "log.mcap", map(stopped, messages())))).setup(ctx)
    assert [line.partition(": ")[2] for line in ctx.warnings] == [
        "odometry stands still at 19 images, ground truth moves 1.9 m"
    ]


@pytest.mark.parametrize(("rate", "told"), [(0.01, ["rate=0.01 uses 1 of 20 images: type"]), (1.0, []), (None, [])])
def test_a_rate_that_uses_hardly_an_image_is_told(log: str, rate: float | None, told: list[str]) -> None:
    ctx = Context("source")
    LogSource(log=log, rate_hz=rate).setup(ctx)
    assert [line[: len(begins)] for line, begins in zip(ctx.warnings, told, strict=True)] == told


def test_odometry_that_drives_farther_than_ground_truth_is_said() -> None:
    truth = np.column_stack([np.arange(40) * 0.2, np.zeros((40, 2))])
    part = LogPart(SimpleNamespace(name="log", odometry=3.0 * truth), np.arange(40), truth, truth, "measured")  # type: ignore[arg-type]
    ctx = Context("source")
    LogSource(log="log")._begin(ctx, part)
    assert [line.partition(":")[0] for line in ctx.warnings] == ["log"]
    assert "odometry drives 3 times as far as ground truth" in ctx.warnings[0]


def test_images_that_the_truth_places_elsewhere_for_a_while_have_none(tmp_path: Path) -> None:
    def jumped(made: Made) -> list[Made]:
        seconds = (made.stamp - START) / 1e9
        if made.topic != TRUTH or not 3.0 < seconds < 6.0:
            return [made]
        x, y, heading = pose_at(seconds)
        content = make_message("geometry_msgs/msg/PoseStamped", {"pose": pose_fields(x, y + 3.0, heading)}, made.stamp)
        return [made._replace(content=content)]

    ctx = Context("source")
    outs = list(ticks(LogSource(log=str(write_mcap(tmp_path / "log.mcap", messages(jumped)))), ctx))
    without = [(out.tick.stamp - START) / 1e9 for out in outs if out.truth is None]
    assert len(outs) == FRAMES
    assert len(without) == ctx.counts["truth_jump"] == 6
    assert 3.0 < min(without) < max(without) < 6.0
    assert "ground truth jumps by 3.0 m, where odometry does not, and back" in ctx.details["truth_jump"]

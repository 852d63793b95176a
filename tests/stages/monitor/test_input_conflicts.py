import math
from pathlib import Path

import numpy as np
import pytest
from conflicting_logs import (
    AT_TWO_HERTZ,
    CASES,
    ODOMETRY,
    UNNOTICED,
    Case,
    Change,
    as_is,
    changed_log,
    found,
    learned,
    odometry,
    of_another,
    said,
    without_truth,
)
from conftest import DATA, DRIVE, TOUR, needs_data

import omninav
from omninav.pipeline import BadInput, Context, Tick
from omninav.pipeline.mcap.message import Message
from omninav.stages.geometry.plane.se2 import compose
from omninav.stages.monitor.input_conflicts import JUDGEMENTS, InputConflicts, InputConflictsState, Watched, tracked
from omninav.stages.recordings.opening import open_recording
from omninav.stages.values.belief import PoseEstimate
from omninav.stages.values.conflicts import Conflicts
from omninav.stages.values.image import Strip
from omninav.stages.values.length_scale import LengthScale
from omninav.stages.values.maps import ReferenceGraph
from omninav.stages.values.pose import Pose
from omninav.stages.values.similarity import Similarities

HOUSE = DATA / "photoreal-house"


@pytest.fixture(scope="module")
def store() -> ReferenceGraph:
    return learned(str(TOUR))


@pytest.fixture(scope="module")
def house() -> ReferenceGraph:
    return learned(str(HOUSE / "tour.mcap"))


@pytest.mark.parametrize("name", [name for name in CASES if name not in AT_TWO_HERTZ])
def test_what_does_not_fit_is_said_in_one_line(name: str, store: ReferenceGraph, tmp_path: Path) -> None:
    (one,) = found(CASES[name], store, DRIVE, tmp_path)
    assert CASES[name].said in one.sentence


@needs_data
@pytest.mark.parametrize("name", AT_TWO_HERTZ)
def test_late_images_are_noticed_where_they_come_often(name: str, house: ReferenceGraph, tmp_path: Path) -> None:
    (one,) = found(CASES[name], house, HOUSE / "drive.mcap", tmp_path)
    assert CASES[name].said in one.sentence


@needs_data
def test_odometry_of_another_drive_is_noticed(house: ReferenceGraph, tmp_path: Path) -> None:
    case = Case(of_another(HOUSE / "tour.mcap"), "of one robot and one drive")
    (one,) = found(case, house, HOUSE / "drive.mcap", tmp_path)
    assert case.said in one.sentence


@needs_data
@pytest.mark.parametrize(
    ("tour", "drive"),
    [
        (str(HOUSE / "tour.mcap"), str(HOUSE / "drive.mcap")),
        (f"sussex_training:{DATA}/sussex-outdoor-route", f"sussex_repeat:{DATA}/sussex-outdoor-route:infomax_binary"),
        (f"antworld:{DATA}/antworld-rendered/ant1_route1", f"antworld:{DATA}/antworld-rendered/ant1_route2"),
    ],
    ids=["house", "Sussex", "AntWorld"],
)
def test_nothing_is_said_of_recordings_that_fit(tour: str, drive: str) -> None:
    assert [each for each in said(learned(tour), drive) if "No odometry in" not in each.sentence] == []


def test_a_run_says_it_as_a_warning_and_keeps_it(shared_cache: Path, tmp_path: Path) -> None:
    log = changed_log(DRIVE, tmp_path / "drive.mcap", without_truth(CASES["turns reversed"].change))
    run = omninav.run(
        "omniview_mcl", tour=str(TOUR), log=str(log), runs=str(tmp_path), cache=str(shared_cache), plots="none",
        progress=False, record=["conflicts.conflicts"],
    )  # fmt: skip
    (line,) = run.manifest["warnings"]
    assert line.startswith("the images turn against odometry's turns (correlation -0.")
    assert "its heading has the wrong sign" in line
    counted = [len(each.sentences) for each in run.values("conflicts.conflicts")]
    assert counted == sorted(counted)
    assert (counted[0], counted[-1]) == (0, 1)
    stands = np.array([each.misleading for each in run.values("conflicts.conflicts")])
    confidence = run.frames["confidence"].to_numpy()
    assert confidence[stands].max() < 0.5
    assert np.array_equal(stands, np.array(counted) > 0)


def straight(number: int) -> list[Pose]:
    """A robot that drives on, 0.3 m an image."""
    return [Pose(0.3 * n, 0.0, 0.0) for n in range(number)]


def test_a_finding_stands_for_as_long_as_it_is_found_and_is_said_once() -> None:
    ctx, state, watch = Context("conflicts"), InputConflictsState(), InputConflicts()
    rng, kept, standing = np.random.default_rng(0), np.zeros((8, 90), np.float32), []
    for number, pose in enumerate(straight(100)):
        frozen = number in range(20, 45) or number in range(70, 95)
        kept = kept if frozen else (kept + 40.0 * rng.random((8, 90)) * np.ones(90)).astype(np.float32)
        ctx.tick = Tick(number, number * 500_000_000, 0, number, not number)
        standing.append(watch.step(ctx, state, Strip(kept), pose).conflicts.standing)
    stood = [number for number, sentences in enumerate(standing, 1) if sentences]
    assert stood[0] == 23  # the third that is the same
    assert not set(stood) & set(range(60, 73))
    assert set(stood) >= set(range(73, 96))
    assert [sentence[:20] for sentence in ctx.warnings] == ["the camera is frozen"]


@pytest.mark.parametrize("fits", [0.0, 0.25, 1.0])
def test_images_that_fit_no_place_are_said_and_a_quarter_that_fits_is_enough(fits: float) -> None:
    ctx, state, watch, rng = Context("conflicts"), InputConflictsState(), InputConflicts(), np.random.default_rng(1)
    poses = np.column_stack([rng.uniform(0.0, 45.0, 300), rng.uniform(-20.0, 20.0, 300), rng.uniform(-3.1, 3.1, 300)])
    poses[:150] = [(pose.x, pose.y, pose.heading) for pose in straight(150)]
    map = ReferenceGraph(poses, np.zeros((300, 8, 20), np.float32), "histograms", np.zeros((0, 2), np.int64), "truth")
    said = ()
    for number, pose in enumerate(straight(150)):
        values = np.zeros((300, 36), np.float32)
        values[number if rng.random() < fits else rng.integers(150, 300), 0] = 1.0
        ctx.tick = Tick(number, number * 500_000_000, 0, number, not number)
        strip = Strip(
            np.sin(np.arange(720.0).reshape(8, 90) / 9.0).astype(np.float32) + 0.05 * rng.random((8, 90), "f")
        )
        estimate = PoseEstimate(pose, np.eye(3), 1.0, pose)
        seen, scale = Similarities(values), LengthScale(0.4)
        said = watch.step(ctx, state, strip, pose, None, seen, map, scale, estimate=estimate).conflicts.sentences
    assert [sentence[:35] for sentence in said] == (["the images fit no place of the map:"] if fits == 0.0 else [])


def test_a_robot_that_stands_and_is_carried_off_does_not_look_like_a_wrong_unit() -> None:
    def track_said(driven: np.ndarray, leap_m: float, unit: float) -> str:
        rows = np.full((128, 14), np.nan)
        rows[:, 0], rows[:, 9], rows[:, 2:4], rows[:, 5:7] = np.arange(128.0), 0.5, 0.0, 0.0
        rows[:, 1], rows[:, 4] = driven, unit * driven + np.where(np.arange(128) < 64, 0.0, leap_m)
        return tracked(Watched(rows), 0.4)

    stood = np.clip(np.arange(128.0) - 60.0, 0.0, 8.0) / 8.0  # but for 1 m
    assert track_said(stood, 1.2, 1.0) == ""
    assert "odometry is about 0.5 times as long" in track_said(0.2 * np.arange(128.0), 0.0, 2.0)
    assert "odometry is about 0.5 times as long" in track_said(0.2 * np.arange(128.0), 4.0, 2.0)


def of_moved_camera(mount: tuple[float, float, float], sigma_m: float) -> tuple[list[str], bool]:
    """Drives with a camera that is moved on its robot: the findings that hold at the end, and whether they mislead."""
    rng, watch, state, ctx = np.random.default_rng(0), InputConflicts(), InputConflictsState(), Context("watch")
    track, conflicts = np.zeros(3), Conflicts((), (), False)
    covariance = np.diag([sigma_m**2 / 2, sigma_m**2 / 2, 1e-6])
    for number in range(96):
        track = compose(track, (0.2, 0.0, 0.3 * math.sin(number / 5)))
        ctx.tick = Tick(number, number * 500_000_000)
        moved = mount if number > 40 else (0.0, 0.0, 0.0)
        seen = compose((5.0, -2.0, 1.0), compose(track, moved)) + rng.normal(0.0, 0.003, 3)
        at = Pose(*seen.tolist())
        strip = Strip(rng.uniform(0.0, 255.0, (8, 90)).astype(np.float32))
        estimate = PoseEstimate(at, covariance, 1.0, at)
        conflicts = watch.step(ctx, state, strip, Pose(*track.tolist()), estimate=estimate).conflicts
    return [each for each in conflicts.standing if "by landmarks" in each], conflicts.misleading


@pytest.mark.parametrize(
    ("mount", "told", "misleads"),
    [
        ((0.0, 0.0, 0.0), "", False),
        ((0.05, 0.0, math.radians(6.0)), "", False),
        ((0.2, -0.15, 0.0), "+0.20 m forward, -0.15 m to the left and turned by +0 degrees", False),
        ((0.0, 0.0, math.radians(10.0)), "turned by +10 degrees", True),
        ((0.5, 0.0, 0.0), "+0.50 m forward", True),
        ((0.0, 0.0, math.radians(-30.0)), "turned by -30 degrees", True),
    ],
)
def test_a_camera_that_was_moved_on_its_robot_is_told(
    mount: tuple[float, float, float], told: str, misleads: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delitem(JUDGEMENTS, "blind")  # these images are noise
    standing, misleading = of_moved_camera(mount, 0.02)
    assert len(standing) == bool(told)
    assert told in "".join(standing)
    assert misleading == misleads
    assert not of_moved_camera(mount, 0.1)[0]


def test_odometry_that_is_not_believed_says_to_check_its_unit(tmp_path: Path) -> None:
    log = changed_log(DRIVE, tmp_path / "drive.mcap", odometry(lambda pose: pose * (1e3, 1e3, 1.0)))
    with pytest.raises(BadInput, match=r"0\.1 s away; .* most are like this: check the unit \(m, rad\); or type"):
        open_recording(str(log))


def test_a_pause_and_another_log_are_no_leaps_of_the_clock() -> None:
    ctx, state, watch = Context("conflicts"), InputConflictsState(), InputConflicts()
    strip = Strip(np.zeros((8, 90), np.float32))
    poses = [Pose(0.2 * n, 0.0, 0.0) for n in range(20)]
    paused, begins_again = [*poses, poses[-1]], [*poses, Pose(0.0, 0.0, 0.0)]
    for path in (paused, begins_again):
        for number, pose in enumerate(path):
            seconds = number + 3000 * (number == 20)
            ctx.tick = Tick(number, seconds * 10**9, 0, number, number in (0, 20 * (path is begins_again)))
            watch.step(ctx, state, strip, pose)
    assert not [sentence for sentence in ctx.warnings if "clock" in sentence]


def test_without_odometry_nothing_is_said(store: ReferenceGraph, tmp_path: Path) -> None:
    def no_odometry(message: Message, seconds: float) -> Message | None:
        return None if message.topic == ODOMETRY else CASES["images mirrored"].change(message, seconds)

    (one,) = said(store, str(changed_log(DRIVE, tmp_path / "drive.mcap", without_truth(no_odometry))))
    assert one.sentence.startswith("No odometry in")


@pytest.mark.parametrize("change", [as_is, *UNNOTICED.values()], ids=["nothing", *UNNOTICED])
def test_nothing_is_said_where_best_matches_follow_odometry(
    change: Change, store: ReferenceGraph, tmp_path: Path
) -> None:
    assert found(Case(change, ""), store, DRIVE, tmp_path) == []

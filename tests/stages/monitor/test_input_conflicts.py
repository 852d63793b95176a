from pathlib import Path

import numpy as np
import pytest
from conflicting_logs import (
    AT_TWO_HERTZ,
    CASES,
    ODOMETRY,
    Case,
    as_is,
    changed_log,
    found,
    learned,
    odometry,
    said,
    without_truth,
)
from conftest import DATA, DRIVE, TOUR, needs_data

import omninav
from omninav.pipeline import Context, Tick
from omninav.pipeline.mcap.message import Message
from omninav.stages.monitor.input_conflicts import InputConflicts, InputConflictsState
from omninav.stages.recordings.opening import open_recording
from omninav.stages.values.image import Strip
from omninav.stages.values.maps import ReferenceGraph
from omninav.stages.values.pose import Pose

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


def test_odometry_that_is_not_believed_says_to_check_its_unit(tmp_path: Path) -> None:
    log = changed_log(DRIVE, tmp_path / "drive.mcap", odometry(lambda pose: pose * (1e3, 1e3, 1.0)))
    assert open_recording(str(log)).details["impossible_motion"].endswith("most are like this: check the unit (m, rad)")


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


def test_nothing_is_said_where_all_fits(store: ReferenceGraph, tmp_path: Path) -> None:
    assert found(Case(as_is, ""), store, DRIVE, tmp_path) == []

"""Frames that a program pushes one at a time lead to what a run over their log gives."""

import math
import os
import threading
import warnings
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
from conflicting_logs import changed_log
from conftest import DRIVE, TOUR

import omninav
from omninav.stages.recordings.camera_yaml import write_camera
from omninav.stages.recordings.opening import open_recording
from omninav.stages.values.scan import Scan

LONE = np.zeros((1, 1, 3), np.uint8)
SAME = ("trajectory.tum", "metrics.json", "frames.csv", "map.omap")
"""Of result.mcap as well, where no floor plan lies beside the log."""
SOON = {
    "nodes.novelty_threshold.views": 10,
    "nodes.novelty_threshold.min_separation": 3,
    "nodes.map_update.length": 5,
}
"""Settings with which a map that is learned on the way grows within the twenty images."""


@pytest.fixture(scope="module")
def drive(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The first twenty images of the drive, one a second."""
    return beginning(DRIVE, tmp_path_factory.mktemp("drive"), 20.0)


@pytest.fixture(scope="module")
def recording(drive):
    return open_recording(str(drive))


@pytest.fixture(scope="module")
def camera(recording, tmp_path_factory: pytest.TempPathFactory) -> Path:
    file = tmp_path_factory.mktemp("camera") / "camera.yaml"
    file.write_text(write_camera(recording.camera))
    return file


@pytest.fixture(scope="module")
def batch(drive: Path, shared_cache: Path, tmp_path_factory: pytest.TempPathFactory) -> omninav.Run:
    words = {"tour": TOUR, "log": drive, "cache": shared_cache, "progress": False}
    return omninav.run("omniview_mcl", folder=tmp_path_factory.mktemp("batch") / "run", **words)


def beginning(log: Path, folder: Path, end_s: float) -> Path:
    return changed_log(log, folder / log.name, lambda message, seconds: message if seconds < end_s else None)


def frames_of(recording, first: int = 0, stop: int | None = None):
    for k in range(first, len(recording.stamps) if stop is None else stop):
        truth = recording.truth[k] if np.isfinite(recording.truth[k]).all() else None
        odometry, stamp = recording.odometry[k], recording.stamps[k]
        yield {"image": recording.image(k), "odometry": odometry, "stamp": stamp, "truth": truth}


def same_files(one: omninav.Run, other: omninav.Run) -> list[str]:
    return [name for name in SAME if (one.folder / name).read_bytes() != (other.folder / name).read_bytes()]


def test_odometry_that_begins_after_the_first_frame_is_no_motion(recording, camera, batch, tmp_path):
    frames = list(frames_of(recording, 0, 5))
    for late in (0, 3):
        frames[late] = frames[late] | {"odometry": None}
    with omninav.open("omniview_mcl", map=batch.folder / "map.omap", camera=camera, folder=tmp_path / "run") as session:
        outs = [session.step(**frame, new_log=k == 3) for k, frame in enumerate(frames)]
    assert [out["source.motion"] is None for out in outs] == [True, True, False, True, True]
    assert outs[1]["source.odometry"].x == frames[1]["odometry"][0]


def test_a_recording_pushed_frame_by_frame_gives_the_bytes_of_the_batch_run(recording, camera, batch, tmp_path):
    with omninav.open("omniview_mcl", map=batch.folder / "map.omap", camera=camera, folder=tmp_path / "run") as session:
        for frame in frames_of(recording):
            out = session.step(**frame)
    assert same_files(batch, omninav.open_run(tmp_path / "run")) == []
    assert out.estimate.pose.x == batch.frames["estimate_x"].iloc[-1]
    assert out.best_match.reference == batch.frames["reference"].iloc[-1]
    assert out.belief is out["fusion.belief"]


def test_a_map_that_is_learned_on_the_way_is_the_same_too(recording, drive, camera, shared_cache, tmp_path):
    settings = {"log": drive, "cache": shared_cache, "progress": False, **SOON}
    whole = omninav.run("omniview_cml", folder=tmp_path / "batch", **settings)
    session = omninav.open("omniview_cml", camera=camera, folder=tmp_path / "run", **SOON)
    for frame in frames_of(recording):
        session.step(**frame)
    assert same_files(whole, session.close()) == []
    assert len(whole.map)


def test_a_log_that_was_recorded_before_the_last_is_the_same_pushed(
    recording, drive, camera, batch, shared_cache, tmp_path
):
    settings, earlier = {"map": batch.folder / "map.omap", "cache": shared_cache}, beginning(TOUR, tmp_path, 9.0)
    tour = open_recording(str(earlier))
    assert tour.stamps[0] < recording.stamps[-1]
    logs = [str(drive), str(earlier)]
    whole = omninav.run("omniview_mcl", log=logs, folder=tmp_path / "batch", progress=False, **settings)
    with omninav.open("omniview_mcl", camera=camera, folder=tmp_path / "run", **settings) as session:
        for log in (recording, tour):
            for k, frame in enumerate(frames_of(log)):
                session.step(**frame, new_log=k == 0)
    assert same_files(whole, omninav.open_run(tmp_path / "run")) == []


def test_a_mirror_of_which_nothing_is_known_is_the_same_pushed_and_interrupted(
    recording, drive, shared_cache, tmp_path
):
    settings = {"log": drive, "camera": "donut", "cache": shared_cache, "progress": False}
    whole, folder = omninav.run("omniview_cml", folder=tmp_path / "batch", **settings, **SOON), tmp_path / "run"
    with omninav.open("omniview_cml", camera="donut", folder=folder, **SOON) as session:
        with pytest.raises(omninav.BadInput, match="step: no ring of a mirror is found in the image"):
            session.step(image=np.indices((210, 280, 3)).sum(0).astype(np.uint8))
        for frame in frames_of(recording, 0, 9):
            session.step(**frame)
        session.__exit__(RuntimeError, RuntimeError("the program fails"), None)
    with omninav.resume(folder) as session:
        for frame in frames_of(recording, 9):
            session.step(**frame)
    pushed = omninav.open_run(folder)
    assert same_files(whole, pushed) == ["map.omap"]  # which says of which log the ring was found
    assert pushed.map.views[:].tobytes() == whole.map.views[:].tobytes() != b""
    assert "its mirror's ring is the one in image 0" in pushed.manifest["warnings"][0]


@pytest.mark.parametrize("interruption", [RuntimeError, KeyboardInterrupt, SystemExit])
def test_a_session_whose_program_fails_goes_on_with_the_next_frame(recording, camera, batch, tmp_path, interruption):
    folder = tmp_path / "run"
    settings = {"map": batch.folder / "map.omap", "camera": camera, "checkpoint_s": 1e6}
    session = omninav.open("omniview_mcl", folder=folder, **settings)
    for frame in frames_of(recording, 0, 9):
        session.step(**frame)
    with suppress(KeyboardInterrupt):  # which it raises again with its folder
        session.__exit__(interruption, interruption("the program fails"), None)
    with omninav.resume(folder) as session:
        assert session.steps == 9
        for frame in frames_of(recording, 9):
            session.step(**frame)
    assert same_files(batch, omninav.open_run(folder)) == []


@pytest.mark.parametrize("failing", ["stage", "checkpoint"])
def test_a_session_that_lost_frames_says_how_many_when_it_goes_on(
    recording, camera, batch, tmp_path, capsys, monkeypatch, failing
):
    def fails(*_, **__):
        raise ValueError("fails")

    folder = tmp_path / "run"
    settings = {"map": batch.folder / "map.omap", "camera": camera, "checkpoint_s": 1e6}
    session = omninav.open("omniview_mcl", folder=folder, **settings)
    for frame in frames_of(recording, 0, 9):
        session.step(**frame)
        if session.steps == 6:
            session.save()
    if failing == "stage":
        monkeypatch.setattr(session._engine.calls["match"], "step", fails)
        with pytest.raises(omninav.StageFailed):
            session.step(**next(frames_of(recording, 9)))
    else:
        monkeypatch.setattr(session._engine, "save", fails)
    session.__exit__(RuntimeError, RuntimeError("the program fails"), None)
    capsys.readouterr()
    with omninav.resume(folder) as session:
        assert f"{folder}: the last 3 of 9 frames were not kept; omninav.resume takes" in capsys.readouterr().err
        assert session.steps == 6
        for frame in frames_of(recording, 6):
            session.step(**frame)
    assert same_files(batch, omninav.open_run(folder)) == []
    assert "steps" not in omninav.open_run(folder).manifest


@pytest.mark.parametrize("name", ["nope", "hyperbolic"])
def test_a_camera_that_is_none_is_refused_before_a_folder_is_made(name, tmp_path):
    with pytest.raises(omninav.BadInput, match=rf"camera={name}: .*; type camera=PATH/camera\.yaml, or one of"):
        omninav.open("omniview_cml", camera=name, folder=tmp_path / "run")
    assert not (tmp_path / "run").exists()


def test_a_frame_that_is_refused_is_as_if_it_had_not_come(recording, camera, batch, tmp_path):
    first, second = frames_of(recording, 0, 2)
    masked = np.ma.masked_array([0.1, 0.2, 0.3], [False, True, False])
    with omninav.open("omniview_mcl", map=batch.folder / "map.omap", camera=camera, folder=tmp_path / "run") as session:
        session.step(**first)
        for wrong, what in (
            ({**second, "stamp": first["stamp"]}, "is not after that of the image before"),
            ({**second, "image": second["image"][:50]}, "and the camera takes"),
            ({**second, "image": b"no image"}, "cannot be decoded"),
            ({**second, "image": np.zeros_like(second["image"])}, "blank"),
            ({**second, "image": second["image"] / 255}, "expected uint8"),
            ({**second, "stamp": 12.5}, "expected whole nanoseconds"),
            ({**second, "stamp": -1}, "expected nanoseconds since 1970"),
            ({**second, "stamp": 10**9 << 31}, "expected nanoseconds since 1970"),
            ({**second, "motion": (1, 2)}, "expected three finite numbers"),
            ({**second, "motion": (1e300, 0, 0)}, "expected three finite numbers"),
            ({**second, "odometry": None, "motion": (1e4, 0, 0)}, "10000 m since the image before"),
            ({**second, "motion": (0.0, 0.0, 0.0)}, "motion=… and odometry=… are both given"),
            ({**second, "odometry": np.array([1 + 2j, 0, 0])}, "expected three finite numbers .*, not complex"),
            ({**second, "odometry": [np.complex64(1), 0, 0]}, "not complex"),
            ({**second, "odometry": masked}, "odometry has masked values, expected an array without a mask"),
            ({**second, "image": np.ma.masked_greater(second["image"], 100)}, "image has masked values"),
            ({**second, "scan": Scan(masked, 0.0, 0.1, 0.0, 1.0)}, "scan has masked values"),
            ({**second, "motion": (math.nan, 0, 0)}, "expected three finite numbers"),
            ({**second, "motion": (number for number in range(3))}, "expected three finite numbers"),
            ({**second, "motion": {0: 1, 1: 2, 2: 3}}, "expected three finite numbers"),
            ({**second, "motion": "123"}, "expected three finite numbers"),
            ({**second, "motion": ()}, "expected three finite numbers"),
            ({**second, "motion": np.broadcast_to(0.0, (3, 10**12))}, "expected three finite numbers"),
            ({**second, "odometry": np.broadcast_to(0.0, 10**12)}, "expected three finite numbers"),
            (
                {**second, "image": np.broadcast_to(LONE, (10**6, 10**6, 3))},
                "1,000,000 x 1,000,000 pixels, expected at",
            ),
            ({**second, "image": np.broadcast_to(LONE[..., 0], (30_000, 30_000))}, "expected at most 33,554,432"),
            ({**second, "image": bytes(100_000_001)}, "100,000,001 bytes, expected at most 100,000,000"),
            ({**second, "scan": Scan(np.broadcast_to(1.0, 10**12), 0.0, 0.1, 0.0, 1.0)}, "expected at most 100,000"),
            ({**second, "truth": "abc"}, "expected three finite numbers"),
            ({**second, "stamp": "x" * 10_000}, "expected whole nanoseconds"),
            ({**second, "scan": "x"}, "expected Scan"),
            ({**second, "new_log": "yes"}, "expected True or False"),
            ({**second, "img": second["image"]}, "did you mean 'image'"),
            ({"stamp": 1}, "image=… is missing"),
        ):
            with pytest.raises(omninav.BadInput, match=what) as refused:
                session.step(**wrong)
            assert len(str(refused.value)) < 300
        out = session.step(**second)
        assert session.steps == 2
    assert out.estimate.pose.x == batch.frames["estimate_x"].iloc[1]


def test_motions_lead_where_the_odometry_leads(recording, camera, tmp_path):
    from omninav.stages.geometry.plane.se2 import between

    with omninav.open("omniview_cml", camera=camera, folder=tmp_path / "run", start="origin") as session:
        for k, frame in enumerate(frames_of(recording, 0, 4)):
            odometry = frame.pop("odometry")
            motion = (0, 0, 0) if k == 0 else between(recording.odometry[k - 1], odometry)
            out = session.step(**frame, motion=motion)
    assert (out["source.motion"].x, out["source.motion"].turn) == pytest.approx((motion[0], motion[2]))
    expected = between(recording.odometry[0], recording.odometry[3])
    assert (out["source.odometry"].x, out["source.odometry"].y) == pytest.approx(tuple(expected[:2]))


def test_the_map_of_a_session_is_learned_from_a_tour(recording, camera, shared_cache, tmp_path):
    settings = {"tour": TOUR, "camera": camera, "cache": shared_cache, "folder": tmp_path / "toured"}
    with omninav.open("plain_matching", **settings) as session:
        assert "best_match" in repr(session.step(image=recording.image(0), stamp=1))


def test_a_closed_session_takes_no_more_frames(recording, camera, tmp_path):
    session = omninav.open("omniview_cml", camera=camera, folder=tmp_path / "run")
    session.step(**next(frames_of(recording)))
    session.close()
    with pytest.raises(omninav.BadInput, match="the session is closed"):
        session.step(**next(frames_of(recording)))


def test_motion_that_is_needed_and_missing_is_said_once_and_counted(recording, camera, tmp_path):
    session = omninav.open("omniview_cml", camera=camera, folder=tmp_path / "run")
    session.step(image=recording.image(0))
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        session.step(image=recording.image(1))
        session.step(image=recording.image(2))
        session.step(image=recording.image(3), motion=(0.1, 0.0, 20.0))  # degrees
    assert sum("came without motion, which" in str(warning.message) for warning in said) == 1
    assert sum("20 rad in 1 s is faster than robots are" in str(warning.message) for warning in said) == 1
    assert session.close().manifest["dropped"]["source.no_motion"]["count"] == 2


@pytest.mark.parametrize(
    ("variant", "settings", "said"),
    [
        ("omniview_mcl", {}, "needs a map"),
        ("omniview_cml", {"camera": None}, "type camera=FILE"),
        ("omniview_mcl", {"tour": "nowhere.mcap"}, r"nowhere\.mcap"),
        ("omniview_mcl", {"log": "drive.mcap"}, r"log=…: .*omninav\.run reads a log"),
        ("omniview_mcl", {"objective": "nonsense"}, r"objective=…: .*close\(\)\.metrics"),
        ("two_views", {"camera": None}, r"two_views: nothing can be pushed into it .*use omninav\.run"),
    ],
)
def test_what_a_session_lacks_or_does_not_take_is_said(camera, variant, settings, said):
    given = {name: value for name, value in ({"camera": camera} | settings).items() if value is not None}
    with pytest.raises((omninav.BadInput, omninav.ProblemsFound), match=said):
        omninav.open(variant, **given)


def test_a_variant_that_drives_gives_its_caller_the_command(recording, camera, tmp_path):
    with omninav.open("homing", camera=camera, folder=tmp_path / "run") as session:
        for k in range(3):
            out = session.step(image=recording.image(k), motion=(0.1, 0.0, 0.0), stamp=recording.stamps[k])
    assert abs(out.command.speed) + abs(out.command.turning) > 0.0  # its target lies behind it


@pytest.fixture
def session(batch, camera, tmp_path):
    return omninav.open("omniview_mcl", map=batch.folder / "map.omap", camera=camera, folder=tmp_path / "run")


def test_what_leaves_a_step_or_a_map_cannot_change_the_run(recording, batch, session):
    for frame in frames_of(recording):
        out = session.step(**frame)
        for array in (out.belief.poses, out.belief.weights, out["match.similarities"].values, out.image.pixels):
            with pytest.raises(ValueError, match="read-only"):
                array += 1
    assert same_files(batch, session.close()) == []
    for map in (batch.map, omninav.load_map(batch.folder / "map.omap")):
        with pytest.raises(ValueError, match="read-only"):
            map.poses[0] = 0.0


def test_a_map_that_a_step_gives_stays_as_it_is_given(recording, camera, tmp_path):
    with omninav.open("omniview_cml", camera=camera, folder=tmp_path / "run", **SOON) as session:
        given = [session.step(**frame)["mapping.map"] for frame in frames_of(recording)]
    sizes = [len(map) for map in given]
    assert sizes[-1] > sizes[0]
    assert [len(map) for map in given] == sizes
    with pytest.raises(ValueError, match="read-only"):
        given[-1].means[...] = 0.0


def test_images_in_any_order_of_memory_and_arrays_that_the_caller_reuses_give_the_same(recording, batch, session):
    buffer, pose = np.empty_like(recording.image(0)), np.empty(3)
    for frame in frames_of(recording):
        turned = np.ascontiguousarray(frame["image"].transpose(1, 0, 2)).transpose(1, 0, 2)  # columns first
        assert not turned.flags.c_contiguous
        buffer[...], pose[...] = turned, frame["odometry"]
        given = turned if frame["stamp"] % 2 else buffer
        session.step(**{**frame, "image": given, "odometry": pose, "stamp": np.int64(frame["stamp"])})
        buffer[...], pose[...] = 0, 0.0
    assert same_files(batch, session.close()) == []


def test_a_second_thread_is_refused_during_a_step_and_may_close_after_it(recording, batch, session):
    frames = list(frames_of(recording))
    session.step(**frames[0])
    tick, inside, go_on, refused = session._engine.tick, threading.Event(), threading.Event(), []

    def slow() -> bool:
        inside.set()
        assert go_on.wait(60)
        return bool(tick())

    session._engine.tick = slow
    first = threading.Thread(target=lambda: session.step(**frames[1]))
    first.start()
    assert inside.wait(60)
    for act in (lambda: session.step(**frames[2]), session.save):
        with pytest.raises(omninav.BadInput, match="in the middle of a step; use it from one thread at a time"):
            act()
    session._engine.tick = tick
    closing = threading.Thread(target=lambda: refused.append(session.close().status))
    closing.start()
    go_on.set()
    first.join()
    closing.join()
    assert refused == ["complete"]


def test_a_forked_process_is_refused_and_leaves_the_session_as_it_is(recording, batch, session):
    frames = list(frames_of(recording))
    said, told = os.pipe()
    with session:
        for frame in frames[:5]:
            session.step(**frame)
        child = os.fork()
        if child == 0:
            try:
                with session:
                    session.step(**frames[5])
            except omninav.BadInput as error:
                os.write(told, str(error).encode())
            finally:
                os._exit(0)
        os.waitpid(child, 0)
        assert f"process {os.getpid()} has this session; open another one" in os.read(said, 4096).decode()
        for frame in frames[5:]:
            session.step(**frame)
    assert same_files(batch, omninav.open_run(session.folder)) == []


def test_a_program_may_change_its_folder_between_steps(recording, batch, camera, tmp_path, monkeypatch):
    settings = {"map": batch.folder / "map.omap", "camera": camera}
    for folder, place in (("own", Path("own")), (None, Path("runs"))):
        here, elsewhere = tmp_path / f"here {place}", tmp_path / f"elsewhere {place}"
        here.mkdir()
        elsewhere.mkdir()
        monkeypatch.chdir(here)
        session = omninav.open("omniview_mcl", folder=folder, runs="runs", cache="cache", **settings)
        for frame in frames_of(recording):
            monkeypatch.chdir(elsewhere)
            session.step(**frame)
        made = session.close()
        assert made.folder.is_relative_to(here / place)
        assert same_files(batch, made) == []
        assert not list(elsewhere.iterdir())

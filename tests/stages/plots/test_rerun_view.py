"""Rerun shows a run, as its own reader reads it."""

import socket
import sys
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from landmark_tour import mapped_room
from result_of import shown_of
from small_run import small_run

from omninav.pipeline import BadInput, Context
from omninav.stages.plots.panorama_snapshot import EncodedPanorama
from omninav.stages.plots.rerun_view import RerunView
from omninav.stages.plots.show_tick import ROW
from omninav.stages.plots.tick_messages import PathSoFar
from omninav.stages.plots.watch_run import WatchRun
from omninav.stages.values.confidence import PoseConfidence

FRAMES = 4
INPUTS = {"confidence": PoseConfidence(0.8), "panorama": EncodedPanorama(b"\xff\xd8 a picture")}


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def rows(file: Path, entity: str, component: str) -> Iterator[tuple[int, np.ndarray]]:
    """Times (ns) and values of a component of an entity."""
    from rerun.chunk import RrdReader

    for chunk in RrdReader(str(file)).stream():
        batch = chunk.to_record_batch()
        if chunk.entity_path == f"/{entity}" and component in batch.schema.names:
            for time, value in zip(batch["time"].cast("int64").to_pylist(), batch[component].to_pylist(), strict=True):
                yield time, np.array(value)


@pytest.fixture
def shown(tmp_path: Path):
    pytest.importorskip("rerun", reason="rerun-sdk is not installed: pip install 'omninav[rerun]'")
    run, map = small_run(frames=FRAMES), mapped_room()
    ticks = shown_of(run, map=map, **INPUTS)
    view = RerunView(tmp_path, free_port())
    for tick in ticks:
        view.show(tick, map)
    view.close()
    return ticks, map, tmp_path / "result.rrd"


def test_reruns_reader_finds_estimates_belief_and_confidence_at_their_times(shown) -> None:
    ticks, _, file = shown
    numbers = np.stack([tick.numbers for tick in ticks]).view(ROW)[:, 0]
    found = sorted(rows(file, "world/estimate", "Arrows3D:origins"), key=lambda row: row[0])
    assert [time for time, _ in found] == [tick.tick.stamp for tick in ticks]
    np.testing.assert_allclose([value[0, :2] for _, value in found], numbers["estimate"][:, :2], atol=1e-5)
    arrows = sorted(rows(file, "world/estimate", "Arrows3D:vectors"), key=lambda row: row[0])
    headings = [np.arctan2(value[0, 1], value[0, 0]) for _, value in arrows]
    np.testing.assert_allclose(np.exp(1j * np.array(headings)), np.exp(1j * numbers["estimate"][:, 2]), atol=1e-5)
    assert [len(value) for _, value in rows(file, "world/belief", "Points3D:positions")] == [
        len(tick.belief) for tick in ticks
    ]
    assert [float(value[0]) for _, value in rows(file, "confidence", "Scalars:scalars")] == [0.8] * FRAMES
    assert len(list(rows(file, "world/estimate/path", "LineStrips3D:strips"))) == FRAMES - 1


def test_the_map_is_shown_once_with_its_landmarks(shown) -> None:
    _, map, file = shown
    ((_, references),) = rows(file, "world/map", "Points3D:positions")
    np.testing.assert_allclose(references[:, :2], map.poses[:, :2], atol=1e-5)
    ((_, points),) = rows(file, "world/landmarks", "Points3D:positions")
    np.testing.assert_allclose(points, map.landmarks.points, atol=1e-5)


def test_a_resumed_run_goes_on_in_another_file(shown, tmp_path: Path) -> None:
    RerunView(tmp_path, free_port()).close()
    assert (tmp_path / "result_2.rrd").exists()


def test_what_was_shown_is_in_the_file_of_a_run_that_is_killed(shown, tmp_path: Path) -> None:
    ticks, _, _ = shown
    view, end = RerunView(tmp_path, free_port()), time.monotonic() + 60.0
    for tick in ticks:
        view.show(tick, None)
    while len(list(rows(tmp_path / "result_2.rrd", "world/estimate", "Arrows3D:origins"))) < FRAMES:
        assert time.monotonic() < end
        time.sleep(0.2)
    view.close()


def test_a_long_runs_file_has_as_few_pictures_as_its_log(shown, tmp_path: Path) -> None:
    ticks, _, _ = shown
    view = RerunView(tmp_path, free_port())
    for tick in ticks:
        view.show(replace(tick, views_every=2), None)
    view.close()
    file = tmp_path / "result_2.rrd"
    assert len(list(rows(file, "panorama", "EncodedImage:blob"))) == FRAMES / 2
    assert len(list(rows(file, "world/belief", "Points3D:positions"))) == FRAMES / 2
    assert len(list(rows(file, "world/estimate", "Arrows3D:origins"))) == FRAMES


def test_jobs_of_two_sweeps_are_two_recordings(tmp_path: Path) -> None:
    reader = pytest.importorskip("rerun.chunk").RrdReader
    names = []
    for job in (tmp_path / "a" / "0", tmp_path / "b" / "0"):
        job.mkdir(parents=True)
        RerunView(job, free_port()).close()
        names += [entry.recording_id for entry in reader(str(job / "result.rrd")).recordings()]
    assert len(set(names)) == 2


def test_only_this_computer_is_served(tmp_path: Path) -> None:
    pytest.importorskip("rerun")
    port = free_port()
    view = RerunView(tmp_path, port)
    socket.create_connection(("127.0.0.1", port), timeout=5).close()
    with pytest.raises(OSError, match=r"refused|unreachable|timed out"):  # as it would be at any other address
        socket.create_connection(("127.0.0.2", port), timeout=5)
    view.close()


def test_a_later_run_of_the_process_takes_the_port_over(tmp_path: Path) -> None:
    pytest.importorskip("rerun")
    port = free_port()
    for _ in range(3):
        view = RerunView(tmp_path, port)
    socket.create_connection(("127.0.0.1", port), timeout=5).close()
    view.close()
    assert len(list(tmp_path.glob("*.rrd"))) == 3


def test_a_missing_library_and_a_taken_port_are_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        monkeypatch.setitem(sys.modules, "rerun", sys)
        with pytest.raises(BadInput, match=rf"^watch: 127\.0\.0\.1:{port} cannot be listened on [^\n]*$"):
            RerunView(None, port)
    monkeypatch.setitem(sys.modules, "rerun", None)
    with pytest.raises(BadInput, match=r"rerun-sdk is not installed: pip install 'omninav\[rerun\]'$"):
        WatchRun(viewer="rerun").setup(Context("watch"))


def test_nothing_is_shown_unless_it_is_asked_for() -> None:
    stage, (tick, *_) = WatchRun(), shown_of(small_run(frames=1))
    stage.setup(Context("watch"))
    stage.step(Context("watch"), PathSoFar(), tick)

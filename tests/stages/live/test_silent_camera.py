"""A whole localiser on a robot whose camera stops on the way; the transport is the test's own."""

from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from conflicting_logs import CASES, changed_log
from conftest import DRIVE, TOUR

import omninav
from omninav.pipeline.mcap.reader import LogReader
from omninav.stages.live import intake, publish
from omninav.stages.live import live_source as live
from omninav.stages.live.publish import WARN
from omninav.stages.live.transport import Arrival

from .conftest import Wire

CAMERA = Path(__file__).parents[2] / "data/camera.yaml"
IMAGE = "/camera/image/compressed"
SILENT = range(20, 30)
"""Images of the drive, one a second, that never come."""


class Recorded(Wire):
    """A robot that says what a recorded one said, one message whenever it is listened to, by a clock of its own."""

    def __init__(self, drive: Path = DRIVE, silent: range = SILENT) -> None:
        super().__init__()
        self.now_s = 0.0
        self._script = self._messages(drive, silent)

    def take(self, timeout_s: float = 0.0) -> Arrival | None:
        return next(self._script, None)

    def _messages(self, drive: Path, silent: range) -> Iterator[Arrival | None]:
        reader, images = LogReader(drive), 0
        types = reader.topics
        for each in sorted(reader.scan({"/odom", "/ground_truth/pose", IMAGE}), key=lambda record: record.log_time):
            self.now_s = each.log_time / 1e9
            images += each.topic == IMAGE
            if each.topic == IMAGE and images - 1 in silent:
                continue
            yield Arrival(each.topic, types[each.topic], each.log_time, bytes(each.data))
            yield None


def localised(robot: Recorded, monkeypatch: pytest.MonkeyPatch, folder: Path, cache: Path) -> Any:
    """A live run on a robot."""
    for module in (live, publish):
        monkeypatch.setattr(module, "connect", lambda name, domain: robot)
    for module in (live, intake):
        monkeypatch.setattr(module, "time", SimpleNamespace(monotonic=lambda: robot.now_s))
    monkeypatch.setattr(live, "disconnect", lambda: None)
    words = ("omniview_mcl", "source=live", "publish=ros2", "log=live", f"tour={TOUR}", f"camera={CAMERA}")
    settings = ("nodes.prior.number=200", "nodes.source.seconds=45")
    return omninav.run(*words, *settings, folder=folder, cache=cache, progress=False)


def test_inputs_that_do_not_fit_are_said_in_diagnostics_while_they_do_not(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, shared_cache: Path
):
    reversed_turns = changed_log(DRIVE, tmp_path / "drive.mcap", CASES["turns reversed"].change)
    robot = Recorded(reversed_turns, range(0))
    run = localised(robot, monkeypatch, tmp_path / "run", shared_cache)
    states = [status for message in robot.on("/diagnostics") for status in message.status]
    said = [state for state in states if "the images turn against odometry's turns" in state.message]
    assert {state.level for state in said} == {WARN}
    assert states.index(said[0]) > len(states) // 3  # not before it was found
    assert "the images turn against" in robot.status.line()  # which the terminal shows
    assert any("the images turn against" in line for line in run.manifest["warnings"])


def test_a_localiser_bridges_ten_seconds_without_images_by_odometry(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, shared_cache: Path
):
    robot = Recorded()
    run = localised(robot, monkeypatch, tmp_path / "run", shared_cache)
    said = {status.message for message in robot.on("/diagnostics") for status in message.status}
    assert any(f"{IMAGE} (sensor_msgs/msg/CompressedImage) has been silent for 9 s" in words for words in said), said
    assert "running" in said
    seconds = run.frames["stamp_ns"].to_numpy() / 1e9
    (gap,) = np.flatnonzero(np.diff(seconds) > 1.5)
    assert np.diff(seconds)[gap] == pytest.approx(len(SILENT) + 1)
    assert run.frames["position_error_m"].to_numpy()[gap + 1 :].max() < 0.5

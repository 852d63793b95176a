"""A map that is learned on a robot, and the same from the record of that run."""

from collections.abc import Iterator
from pathlib import Path

import pytest
from conftest import DRIVE

import omninav
from omninav.pipeline.mcap.reader import LogReader
from omninav.stages.live import live_source as live
from omninav.stages.live import publish
from omninav.stages.live.transport import Arrival

from .conftest import Wire

CAMERA = Path(__file__).parents[2] / "data/camera.yaml"
TOPICS = {"/odom", "/ground_truth/pose", "/camera/image/compressed"}


class Recorded(Wire):
    """A robot that says what a recorded one said, one message whenever it is listened to; some images are overtaken."""

    def __init__(self) -> None:
        super().__init__()
        self._script = self._messages()

    def take(self, timeout_s: float = 0.0) -> Arrival | None:
        return next(self._script, None)

    def _messages(self) -> Iterator[Arrival | None]:
        reader = LogReader(DRIVE)
        types = reader.topics
        for number, each in enumerate(sorted(reader.scan(TOPICS), key=lambda record: record.log_time)):
            yield Arrival(each.topic, types[each.topic], each.log_time, bytes(each.data))
            if number % 50 == 0:
                yield None


def test_a_map_learned_live_is_that_of_its_record(monkeypatch: pytest.MonkeyPatch, tmp_path: Path, shared_cache: Path):
    robot = Recorded()
    for module in (live, publish):
        monkeypatch.setattr(module, "connect", lambda name, domain: robot)
    monkeypatch.setattr(live, "disconnect", lambda: None)
    words = {"camera": CAMERA, "cache": shared_cache, "progress": False, "plots": "none"}
    settings = ("source=live", "publish=ros2", "log=live", "nodes.source.seconds=4")
    driven = omninav.run("omniview_cml", *settings, folder=tmp_path / "driven", **words)
    again = omninav.run("omniview_cml", log=driven.folder / "live.mcap", folder=tmp_path / "again", **words)
    assert driven.manifest["dropped"]["source.overtaken_image"]["count"] > 0
    assert "rate_hz" in driven.manifest["facts"]
    for name in ("map.omap", "frames.csv", "trajectory.tum"):
        assert (driven.folder / name).read_bytes() == (again.folder / name).read_bytes(), name

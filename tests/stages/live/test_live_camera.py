"""A camera of this computer in the place of a robot, stood for by a video; and a robot without odometry."""

import math
import threading
from pathlib import Path
from types import SimpleNamespace

import cv2
import numpy as np
import pytest

from omninav.pipeline import BadInput, Context
from omninav.stages.live import camera_transport
from omninav.stages.live.live_source import LiveSource, LiveSourceState
from omninav.stages.recordings.recording import Topics

from .conftest import replayed, same

FRAMES = 8


@pytest.fixture
def device(tmp_path: Path) -> str:
    """A video of equirectangular images, 20 a second, of a camera that turns to the left by 5 degrees each time."""
    scene = cv2.GaussianBlur(np.random.default_rng(0).integers(0, 256, (72, 144, 3)).astype(np.uint8), (0, 0), 2)
    writer = cv2.VideoWriter(str(tmp_path / "turn.avi"), cv2.VideoWriter_fourcc(*"MJPG"), 20.0, (144, 72))
    for number in range(FRAMES + 1):
        writer.write(np.roll(scene, 2 * number, axis=1))
    writer.release()
    return str(tmp_path / "turn.avi")


@pytest.fixture
def turns(monkeypatch: pytest.MonkeyPatch) -> threading.Semaphore:
    """How many images the camera may show, as the test's ticks allow: however slow the machine is, none gets all."""
    turns = threading.Semaphore(2)

    class Turn(threading.Event):
        def wait(self, timeout: float | None = None) -> bool:
            turns.acquire(timeout=60.0)
            return self.is_set()

    own = SimpleNamespace(Event=Turn, Thread=threading.Thread, Condition=threading.Condition)
    monkeypatch.setattr(camera_transport, "threading", own)
    return turns


def test_a_camera_that_is_plugged_in_is_a_live_run_whose_record_gives_the_same(
    device: str, tmp_path: Path, turns: threading.Semaphore
):
    ctx, state, live = Context("source", folder=tmp_path), LiveSourceState(), []
    source = LiveSource(log=f"camera:{device}", speed_m_s=0.5, diagnostics=None)
    source.setup(ctx)
    while (out := source.step(ctx, state)) is not None:
        live.append(out)
        turns.release(2)  # images are overtaken
    assert len(live) + ctx.counts["overtaken_image"] == FRAMES
    assert len(live) >= FRAMES // 2
    assert ctx.facts["odometry"] == "guessed"
    assert any("equirectangular" in sentence for sentence in ctx.warnings)
    turned = math.degrees(live[-1].odometry.heading - live[0].odometry.heading)
    assert math.remainder(turned, 5.0) == pytest.approx(0.0, abs=0.7)
    assert turned > 4.0
    same(live, replayed(tmp_path / "live.mcap", speed_m_s=0.5))


def test_what_cannot_be_a_live_run_is_refused_before_it_starts(device: str):
    ctx = Context("source")
    ctx.readers = {"motion": ["motion"]}
    for source, why in (
        (LiveSource(log=f"camera:{device}"), r"log=camera:.*needed by 'motion'; type speed=0\.5"),
        (
            LiveSource(topics=Topics(odometry=None)),
            r"the robot has neither odometry .*needed by 'motion'; type speed=0\.5",
        ),
        (LiveSource(log="camera:/dev/none", speed_m_s=0.5), "there is no camera /dev/none"),
        (LiveSource(log="drive.mcap"), r"log=drive\.mcap: .*omninav log=drive\.mcap"),
    ):
        with pytest.raises(BadInput, match=why):
            source.check(ctx)

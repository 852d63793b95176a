"""Motion of logs that say nothing of it: a guessed speed, and turns that are seen."""

import math
from pathlib import Path

import cv2
import numpy as np
import pytest

from omninav.pipeline import Context
from omninav.stages.geometry.appearance.visual_compass import turn_between
from omninav.stages.motion.rotation_translation_rotation import RotationTranslationRotation
from omninav.stages.recordings.recording import UnreadableRecording
from omninav.stages.source.dead_reckoning import assumed_motion
from omninav.stages.source.log import LogSource
from omninav.stages.source.playback import PlaybackState
from omninav.stages.values.pose import AssumedMotion, Motion

TURNS_DEG = (0.0, 5.0, 5.0, -20.0, 90.0)


def context(**readers: list[str]) -> Context:
    made = Context("source", np.random.default_rng(0))
    made.readers = readers
    return made


@pytest.fixture
def turning(tmp_path: Path) -> str:
    """Five equirectangular images, one each second, of a camera that turns on the spot."""
    scene = cv2.GaussianBlur(np.random.default_rng(0).integers(0, 256, (72, 144, 3)).astype(np.uint8), (0, 0), 2)
    writer = cv2.VideoWriter(str(tmp_path / "turn.avi"), cv2.VideoWriter_fourcc(*"MJPG"), 1.0, (144, 72))
    for heading in np.cumsum(TURNS_DEG):
        writer.write(np.roll(scene, round(heading / 2.5), axis=1))  # a turn to the left moves the scene to the right
    writer.release()
    return str(tmp_path / "turn.avi")


def test_the_compass_finds_turns_between_columns():
    azimuths = np.linspace(0, 2 * math.pi, 360, endpoint=False)

    def view(heading: float) -> np.ndarray:
        rows = [np.sin(azimuths - heading + 0.3), np.cos(3 * (azimuths - heading)), np.sin(7 * (azimuths - heading))]
        return np.array(rows, np.float32)

    for turn in (0.0, 0.0123, -1.0, 3.0):
        assert turn_between(view(0.2), view(0.2 + turn)) == pytest.approx(turn, abs=1e-3)


def test_a_video_drives_straight_at_the_stated_speed_and_turns_as_it_is_seen(turning: str) -> None:
    source, ctx, position, outs = LogSource(log=turning, speed_m_s=0.8), context(), PlaybackState(), []
    source.setup(ctx)
    while (out := source.step(ctx, position)) is not None:
        outs.append(out)
    assert outs[0].motion is None
    assert [math.degrees(out.motion.turn) for out in outs[1:]] == pytest.approx(TURNS_DEG[1:], abs=0.5)
    for out in outs[1:]:
        assert isinstance(out.motion, AssumedMotion)
        assert math.hypot(out.motion.x, out.motion.y) == pytest.approx(0.8)
        assert out.motion.sigma_m == pytest.approx(0.8 / math.sqrt(2.0))
    assert math.degrees(outs[-1].odometry.heading) == pytest.approx(sum(TURNS_DEG), abs=1.0)
    assert ctx.facts["odometry"] == "guessed"
    assert any("guessed from a speed of 0.8 m/s" in sentence for sentence in ctx.warnings)


def test_who_reads_motion_is_refused_by_name_until_a_speed_is_stated(turning: str) -> None:
    with pytest.raises(
        UnreadableRecording, match=r"turn.avi has neither odometry nor a position.*'motion'.*type speed=0.5"
    ):
        LogSource(log=turning).setup(context(motion=["motion", "sensor"]))
    with pytest.raises(UnreadableRecording, match=r"speed=0 .*'mapping' makes a map of positions"):
        LogSource(log=turning, speed_m_s=0.0).setup(context(odometry=["mapping"]))
    LogSource(log=turning, speed_m_s=0.0).setup(context(motion=["motion"]))
    ctx = context()
    LogSource(log=turning).setup(ctx)
    assert any("drawn as if driven" in sentence for sentence in ctx.warnings)


def test_a_guessed_motion_is_as_uncertain_as_it_says():
    noise = RotationTranslationRotation()
    measured, guessed = noise.model(Motion(0.5, 0.0, 0.0)), noise.model(AssumedMotion(0.5, 0.0, 0.0, 0.5, 0.1))
    assert guessed.sigmas[1] == pytest.approx(math.hypot(measured.sigmas[1], 0.5))
    assert guessed.sigmas[0] == pytest.approx(math.hypot(measured.sigmas[0], 0.1 / math.sqrt(2)))


def test_a_slow_guess_is_as_uncertain_as_one_of_half_a_metre_per_second():
    motion = assumed_motion(None, None, 2.0, 0.25)
    assert (motion.x, motion.y, motion.turn, motion.sigma_m, motion.sigma_turn) == (0.5, 0.0, 0.0, 0.5, 0.5)
    around = np.sin(np.linspace(0, 2 * math.pi, 360, endpoint=False), dtype=np.float32)[None]
    turned = assumed_motion(around, np.roll(around, 90, axis=1), 4.0, 0.75)  # to the left
    eighth = 3.0 / math.sqrt(2.0)  # half of the turn is before the way
    found = (turned.x, turned.y, turned.turn, turned.sigma_m, turned.sigma_turn)
    assert found == pytest.approx((eighth, eighth, math.pi / 2, 0.75 * math.sqrt(2.0), math.radians(3.0)), abs=1e-3)


@pytest.mark.parametrize("rate", [0.5, 2.0, 30.0])
def test_a_guess_is_as_uncertain_at_any_rate_of_images_as_at_two_a_second(rate: float):
    motion = assumed_motion(None, None, 1.0 / rate, 0.8)
    assert math.sqrt(rate) * motion.sigma_m == pytest.approx(math.sqrt(2.0) * 0.8 * 0.5)
    assert math.sqrt(rate) * motion.sigma_turn == pytest.approx(math.sqrt(2.0) * 0.5 * 0.5)


def test_a_rate_takes_the_first_image_of_each_period(turning: str) -> None:
    source, ctx, position = LogSource(log=turning, rate_hz=0.5), context(), PlaybackState()
    source.setup(ctx)
    frames = []
    while (out := source.step(ctx, position)) is not None:
        frames.append(out.tick.frame)
    assert frames == [0, 2, 4]
    assert source.length() == 3

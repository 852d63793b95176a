"""Drives through the demo world as recordings, and as logs."""

import dataclasses
from pathlib import Path

import cv2
import numpy as np
import pytest
from world_files import DEMO

from omninav.stages.recordings.recording import Recording, UnreadableRecording
from omninav.stages.simulator import simulated_recording as simulated
from omninav.stages.simulator.config import Day, Route
from omninav.stages.simulator.simulated_log import record
from omninav.stages.simulator.simulated_recording import SimulatedRecording
from omninav.stages.simulator.world import World


@pytest.fixture(scope="module")
def tour() -> SimulatedRecording:
    return SimulatedRecording(DEMO, "tour", 0)


def test_a_simulated_drive_is_a_recording(tour: SimulatedRecording) -> None:
    recording: Recording = tour
    assert recording.image(0).shape == (480, 640, 3)  # type: ignore[union-attr]
    assert (np.diff(recording.stamps) == 500_000_000).all()
    assert len(recording.stamps) == len(recording.truth) == len(recording.odometry)  # type: ignore[arg-type]
    assert not recording.dropped


@pytest.mark.parametrize(("route", "least", "most"), [("tour", 120, 160), ("drive", 80, 105)])
@pytest.mark.parametrize("day", [0, 1, 2, 5])
def test_routes_have_their_length_and_never_touch_anything(route: str, least: int, most: int, day: int) -> None:
    config = DEMO
    recording = SimulatedRecording(config, route, day)
    assert least <= len(recording.stamps) <= most
    assert World(config, day).is_free(recording.driven[:, :2], config.robot.radius).all()
    steps = np.hypot(*np.diff(recording.truth[:, :2], axis=0).T)
    assert 0.15 < np.median(steps) < 0.25
    assert steps.max() < 0.25


def test_the_same_drive_gives_the_same_pictures_in_any_order(tour: SimulatedRecording) -> None:
    again = SimulatedRecording(DEMO, "tour", 0)
    later, earlier = again.image(9), again.image(4)
    np.testing.assert_array_equal(earlier, tour.image(4))
    np.testing.assert_array_equal(later, tour.image(9))
    np.testing.assert_array_equal(again.odometry, tour.odometry)
    assert again.digest() == tour.digest()


def test_another_day_seed_or_route_is_another_drive(tour: SimulatedRecording) -> None:
    others = [
        SimulatedRecording(DEMO, "tour", 1),
        SimulatedRecording(dataclasses.replace(DEMO, seed=2), "tour", 0),
        SimulatedRecording(DEMO, "drive", 0),
    ]
    assert len({tour.digest(), *(other.digest() for other in others)}) == 4
    for other in others:
        assert not np.array_equal(other.odometry[:20], tour.odometry[:20])
        assert other.stamps[0] != tour.stamps[0] or other.world.seed != tour.world.seed


def test_what_other_days_bring_makes_no_other_drive() -> None:
    """Which goods are moved next week decides neither today's pictures nor whether a map of today is made anew."""
    later = dataclasses.replace(DEMO, days=(*DEMO.days, Day(rearranged=0.6)))
    assert SimulatedRecording(later, "drive", 1).digest() == SimulatedRecording(DEMO, "drive", 1).digest()
    assert SimulatedRecording(later, "drive", 2).digest() != SimulatedRecording(DEMO, "drive", 2).digest()


def test_odometry_drifts_but_not_away(tour: SimulatedRecording) -> None:
    """In the spirit of photoreal-house: a few per cent of the way over stretches of ten metres."""
    shares = []
    for day in range(6):
        recording = SimulatedRecording(DEMO, "drive", day)
        truth, seen = recording.truth, recording.odometry
        way = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(truth[:, :2], axis=0).T))])
        for start in range(0, len(way), 10):
            end = np.searchsorted(way, way[start] + 10.0)
            if end < len(way):
                moved, thought = (simulated.se2.between(p[start], p[end]) for p in (truth, seen))
                shares.append(np.hypot(*(moved - thought)[:2]) / 10.0)
    assert 0.01 < np.median(shares) < 0.08


def test_places_look_different(tour: SimulatedRecording) -> None:
    """Any two pictures far apart differ more, after the best turn, than neighbours along the drive do."""
    frames = range(0, len(tour.stamps), 20)
    rings = {frame: _ring(tour, frame) for k in frames for frame in (k, k + 1) if k + 1 < len(tour.stamps)}
    starts = [k for k in frames if k + 1 in rings]
    near = [_distance(rings[k], rings[k + 1]) for k in starts]
    far = [_distance(rings[a], rings[b]) for a in starts for b in starts if a < b]
    assert np.median(far) > 1.5 * np.median(near)
    assert min(far) > np.median(near)


def _ring(recording: SimulatedRecording, frame: int) -> np.ndarray:
    """A coarse panorama (18, 72, 3) read straight off the mirror picture."""
    azimuth, radius = np.meshgrid(np.arange(72) * 2 * np.pi / 72, np.linspace(60, 225, 18))
    picture = recording.image(frame).astype(float)
    camera = recording.camera
    u, v = camera.centre_x + radius * np.cos(azimuth), camera.centre_y + radius * np.sin(azimuth)
    smooth = cv2.blur(picture, (9, 9))
    return smooth[np.round(v).astype(int), np.round(u).astype(int)]


def _distance(one: np.ndarray, other: np.ndarray) -> float:
    return min(float(np.abs(one - np.roll(other, shift, axis=1)).mean()) for shift in range(72))


def test_a_route_that_is_not_there_is_refused_with_those_that_are() -> None:
    with pytest.raises(UnreadableRecording, match="home_store_demo' has no route 'aisles'; it has: drive, tour"):
        SimulatedRecording(DEMO, "aisles", 0)


def test_a_written_log_reads_back_as_the_same_drive_and_twice_as_the_same_bytes(tmp_path: Path) -> None:
    from omninav.stages.recordings.opening import open_recording

    config = dataclasses.replace(DEMO, routes={"short": Route(((2.0, 1.5), (3.5, 1.5)))})
    recording = SimulatedRecording(config, "short", 2)
    record(recording, tmp_path / "one.mcap")
    record(SimulatedRecording(config, "short", 2), tmp_path / "two.mcap")
    assert (tmp_path / "one.mcap").read_bytes() == (tmp_path / "two.mcap").read_bytes()
    log = open_recording(str(tmp_path / "one.mcap"))
    assert not log.dropped
    np.testing.assert_array_equal(log.stamps, recording.stamps)
    np.testing.assert_allclose(log.truth, recording.truth, atol=1e-9)  # type: ignore[arg-type]
    np.testing.assert_allclose(log.odometry, recording.odometry, atol=1e-9)  # type: ignore[arg-type]
    assert vars(log.camera) == vars(recording.camera)
    assert np.abs(log.image(0).astype(int) - recording.image(0)).mean() < 4  # type: ignore[union-attr]

"""Drives through the demo world as recordings, and as logs."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from world_files import DEMO

from omninav.pipeline.mcap.reader import LogReader
from omninav.stages.geometry.plane.se2 import between
from omninav.stages.recordings.opening import open_recording
from omninav.stages.recordings.recording import Recording, UnreadableRecording
from omninav.stages.simulator.config import Day, Route, mirror
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


def test_odometry_drifts_but_not_away(tour: SimulatedRecording) -> None:
    """In the spirit of photoreal-house: a few per cent of a way of 32 m."""
    true, thought = (between(poses[0], poses[-1]) for poses in (tour.truth, tour.odometry))
    assert 0.3 < np.hypot(*(true - thought)[:2]) < 2.5


@pytest.mark.parametrize(("route", "least", "most"), [("tour", 120, 160), ("drive", 80, 105)])
@pytest.mark.parametrize("day", [0, 1, 2, 5])
def test_routes_have_their_length_and_never_touch_anything(route: str, least: int, most: int, day: int) -> None:
    recording = SimulatedRecording(DEMO, route, day)
    assert least <= len(recording.stamps) <= most
    assert World(DEMO, day).is_free(recording.driven[:, :2], DEMO.robot.radius).all()
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


def test_a_route_that_is_not_there_is_refused_with_those_that_are() -> None:
    with pytest.raises(UnreadableRecording, match="home_store_demo' has no route 'aisles'; it has: drive, tour"):
        SimulatedRecording(DEMO, "aisles", 0)


@pytest.mark.parametrize("delay", [None, 0.1])
def test_a_written_log_reads_back_as_the_same_drive_and_twice_as_the_same_bytes(
    tmp_path: Path, delay: float | None
) -> None:
    route, camera = Route(((2.0, 1.5), (3.5, 1.5))), {**mirror(columns=160), "delay": delay}
    config = dataclasses.replace(DEMO, routes={"short": route}, camera=camera)
    recording = SimulatedRecording(config, "short", 2)
    record(recording, tmp_path / "one.mcap")
    record(SimulatedRecording(config, "short", 2), tmp_path / "two.mcap")
    assert (tmp_path / "one.mcap").read_bytes() == (tmp_path / "two.mcap").read_bytes()
    log = open_recording(str(tmp_path / "one.mcap"))
    assert not log.dropped
    stamped = LogReader(tmp_path / "one.mcap").scan({"/camera/image/compressed"})
    assert next(stamped).stamp == recording.stamps[0] + round((delay or 0.0) * 1e9)
    np.testing.assert_array_equal(log.stamps, recording.stamps)
    np.testing.assert_allclose(log.truth, recording.truth, atol=1e-9)  # type: ignore[arg-type]
    np.testing.assert_allclose(log.odometry, recording.odometry, atol=1e-9)  # type: ignore[arg-type]
    assert vars(log.camera) == vars(recording.camera)
    assert np.abs(log.image(0).astype(int) - recording.image(0)).mean() < 4  # type: ignore[union-attr]

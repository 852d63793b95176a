"""People: where they walk, how near they come, and that they are seen where they stand."""

import dataclasses
import math

import numpy as np
import numpy.typing as npt
import pytest
from world_files import DEMO

from omninav.stages.camera.equirectangular import Equirectangular
from omninav.stages.simulator.cameras import camera_rays
from omninav.stages.simulator.config import Day
from omninav.stages.simulator.people import PARTS, Person, RobotTrack, figures
from omninav.stages.simulator.renderer import render
from omninav.stages.simulator.simulated_recording import SimulatedRecording
from omninav.stages.simulator.world import World

BUSY = dataclasses.replace(DEMO, days=(Day(people=12),))
PANORAMA = Equirectangular(720, 180, column_of_forward=360.0, elevation_top=0.7, elevation_bottom=-0.9)


@pytest.fixture(scope="module")
def busy() -> World:
    return World(BUSY)


@pytest.fixture(scope="module")
def track() -> RobotTrack:
    """A robot that drives along an aisle of the demo, 6 m at 0.1 m/s."""
    times = np.arange(0.0, 60.0, 0.05)
    return RobotTrack(times, np.stack([2.0 + 0.1 * times, np.full_like(times, 4.5), np.zeros_like(times)], axis=1))


def positions(people: tuple[Person, ...]) -> npt.NDArray[np.float64]:
    return np.array([person.position for person in people]).reshape(-1, 2)


def test_walkers_never_walk_through_anything(busy: World) -> None:
    for seconds in np.arange(0.0, 300.0, 1.3):
        assert (busy.clearance(positions(busy.crowd.at(seconds))) > 0.25).all()


def test_walkers_go_no_faster_than_people_do_and_get_about(busy: World) -> None:
    paths = np.array([positions(busy.crowd.at(0.5 * step)) for step in range(600)])
    assert np.hypot(*np.diff(paths, axis=0).T).max() < 0.5 * 1.25
    assert (np.ptp(paths, axis=0).max(axis=1) > 3.0).mean() > 0.7


def test_the_same_time_shows_the_same_people_in_whatever_order_it_is_asked_for(busy: World, track: RobotTrack) -> None:
    times = (40.0, 3.0, 55.5, 40.0)
    other = World(BUSY)
    forth = [busy.crowd.at(seconds, track) for seconds in times]
    assert forth == [other.crowd.at(seconds, track) for seconds in times]
    assert forth[0] == forth[3]
    assert forth[0] != World(BUSY, day=1).crowd.at(40.0, track)


def test_some_keep_the_robot_company_and_nobody_is_run_over_or_trodden_on(busy: World, track: RobotTrack) -> None:
    walkers, beside = {person.height for person in busy.crowd.at(0.0)}, 0
    for seconds in np.arange(10.0, 60.0, 0.5):
        robot = track.poses[np.searchsorted(track.times, seconds), :2]
        people = busy.crowd.at(seconds, track)
        places = positions(people)
        distance = np.hypot(*(places - robot).T)
        assert distance.min() > 0.55
        beside += int((distance < 1.5).any())
        for number, person in enumerate(people):
            if person.height not in walkers:
                assert np.hypot(*(np.delete(places, number, axis=0) - places[number]).T).min() > 0.5
    assert beside > 40  # of 100 moments


@pytest.mark.parametrize("route", ["tour", "drive"])
def test_over_a_drive_everybody_walks_and_nobody_jumps(route: str) -> None:
    """A person is known by its height; who is gone is so for seconds, and neither goes nor comes near the robot."""
    drive = SimulatedRecording(BUSY, route, 0)
    seconds = np.arange(0.0, drive.true_times[-1] * 1e-9 - drive.true_times[0] * 1e-9, 0.05)
    last: dict[float, tuple[float, tuple[float, float]]] = {}
    fastest, gone, seen = 0.0, 0, 0
    for now in seconds:
        for person in drive.people_at(float(now)):
            then, place = last.get(person.height, (now, person.position))
            seen += 1
            if now - then < 0.06:
                fastest = max(fastest, math.dist(place, person.position) / 0.05)
            else:
                gone += 1
                assert now - then >= 5.0 - 0.2
            last[person.height] = (now, person.position)
    assert 1.0 < fastest < 1.31
    assert gone <= 8
    assert seen > 0.85 * 12 * len(seconds)


def test_nobody_knows_where_the_robot_will_go(busy: World, track: RobotTrack) -> None:
    known = track.times <= 30.0
    assert busy.crowd.at(30.0, track) == busy.crowd.at(30.0, RobotTrack(track.times[known], track.poses[known]))


def test_a_person_is_seen_where_it_stands(busy: World) -> None:
    """The pixels that a person changes are those its body covers: bearing, width, head and feet, to a pixel."""
    pose, eye = (5.8, 4.5, 0.4), 0.9
    person = Person((7.6, 4.9), heading=1.0, height=1.7)
    rays = camera_rays(PANORAMA)
    before, after = (render(busy.scene, rays, pose, eye, people=people) for people in ((), (person,)))
    rows, columns = np.nonzero(np.abs(before.astype(int) - after).max(axis=-1) > 4)
    seen: list[tuple[float, float]] = []
    boxes, _ = figures((person,), busy.scene.looks)
    assert len(boxes) == len(PARTS)
    for box in boxes:
        for along in (-1, 1):
            for across in (-1, 1):
                x = box[0] + along * box[2] * box[4] - across * box[3] * box[5] - pose[0]
                y = box[1] + along * box[3] * box[4] + across * box[2] * box[5] - pose[1]
                azimuth = math.atan2(y, x) - pose[2]
                for z in box[6:8]:
                    elevation = math.atan2(z - eye, math.hypot(x, y))
                    seen.append((360.0 - azimuth / (2 * math.pi) * 720, (0.7 - elevation) / 1.6 * 180))
    expected = np.array(seen)
    assert abs(columns.min() - expected[:, 0].min()) < 1.5
    assert abs(columns.max() + 1 - expected[:, 0].max()) < 1.5
    assert abs(rows.min() - expected[:, 1].min()) < 1.5
    assert abs(rows.max() + 1 - expected[:, 1].max()) < 1.5


def test_a_shelf_hides_who_is_behind_it(busy: World) -> None:
    rays = camera_rays(PANORAMA)
    pose = (5.8, 4.5, 0.4)
    without = render(busy.scene, rays, pose, 0.9)
    small = Person((3.7, 1.5), 0.0, height=1.2)
    np.testing.assert_array_equal(without, render(busy.scene, rays, pose, 0.9, people=(small,)))

"""How an experiment records a simulated drive once: what decides the recording, and how it is replayed."""

import dataclasses
from functools import partial
from pathlib import Path

from world_files import DEMO

from omninav.pipeline.graph.recordable import Recordable
from omninav.pipeline.graph.registry import resolve
from omninav.stages.simulator.config import Day
from omninav.stages.source.log import LogSource
from omninav.stages.source.simulated import SimulatedSource

driven = partial(SimulatedSource, world=DEMO)


def test_a_simulated_drive_is_recordable_and_a_log_is_not():
    assert isinstance(SimulatedSource(), Recordable)
    assert not isinstance(LogSource(), Recordable)


def test_what_is_driven_decides_the_recording_and_not_how_it_is_read():
    drive = driven(route="drive", day=1)
    assert drive.recording_key() == driven(route="drive", day=1, stride=2, first=5).recording_key()
    others = [driven(route="tour", day=1), driven(route="drive", day=2), driven(route="drive", day=(1, 2))]
    assert len({drive.recording_key(), *(other.recording_key() for other in others)}) == 4


def test_days_that_are_not_driven_do_not_decide_the_recording():
    busy = dataclasses.replace(DEMO, days=(Day(people=9), *DEMO.days[1:]))
    same, other = SimulatedSource(route="drive", day=1, world=busy), SimulatedSource(route="drive", day=0, world=busy)
    assert same.recording_key() == driven(route="drive", day=1).recording_key()
    assert other.recording_key() != driven(route="drive", day=0).recording_key()


def test_a_route_that_the_world_lacks_is_not_recorded():
    assert driven(route="nowhere").recording_key() is None


def test_a_recorded_drive_is_read_in_place_of_its_world():
    replay = driven(route="drive").replay(Path("recordings/one"))
    assert resolve(replay["_target_"]) is LogSource
    assert replay["log"] == "recordings/one/drive.mcap"
    assert {name for name, value in replay.items() if value is None} == {"world", "route", "day", "kidnappings"}

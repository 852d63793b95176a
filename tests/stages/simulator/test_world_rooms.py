"""Names of rooms, of worlds and logs that have any."""

from pathlib import Path

import pytest

from omninav.pipeline import BadInput, Context
from omninav.pipeline.mcap.writer import written_log
from omninav.stages.recordings.rooms_yaml import ROOMS, write_rooms
from omninav.stages.simulator.config import Room, WorldConfig
from omninav.stages.simulator.world_rooms import WorldRooms, rooms_of
from omninav.stages.values.rooms import Rooms


def test_rooms_of_a_world_are_given_by_name_and_a_logs_place_is_unknown() -> None:
    world = WorldConfig(rooms=(Room(name="kitchen", corner=(2.0, 3.0), size=(4.0, 5.0)),))
    rooms = WorldRooms(world=world).step(Context("rooms")).rooms
    assert rooms.names == ("kitchen",)
    assert rooms.corners.tolist() == [[2.0, 3.0, 6.0, 8.0]]
    assert WorldRooms(world=world, log="drive.mp4").step(Context("rooms")).rooms is None
    assert WorldRooms().step(Context("rooms")).rooms is None


def test_a_log_that_was_recorded_of_a_world_knows_its_rooms(tmp_path: Path) -> None:
    world = rooms_of(WorldConfig(rooms=(Room(name="kitchen", corner=(2.0, 3.0), size=(4.0, 5.0)),)))
    assert world is not None
    for name, text in (("drive", write_rooms(world)), ("odd", "[{name: kitchen, corners: [0, 1]}]"), ("none", None)):
        with written_log(tmp_path / f"{name}.mcap") as log:
            log.attach("camera.yaml", b"{}")
            if text is not None:
                log.attach(ROOMS, text.encode())

    def read(*names: str) -> Rooms | None:
        return WorldRooms(log=tuple(str(tmp_path / f"{name}.mcap") for name in names)).step(Context("rooms")).rooms

    found = read("none", "drive")
    assert found is not None
    assert found.names == world.names
    assert found.corners.tolist() == world.corners.tolist()
    assert read("none") is None
    with pytest.raises(BadInput, match=r"odd\.mcap: attachment rooms\.yaml: rooms.*expected"):
        read("odd")

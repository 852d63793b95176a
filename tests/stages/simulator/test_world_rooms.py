"""Names of rooms, of worlds that have any."""

from omninav.pipeline import Context
from omninav.stages.simulator.config import Room, WorldConfig
from omninav.stages.simulator.demo import DEMO
from omninav.stages.simulator.world_rooms import WorldRooms


def test_rooms_of_a_world_are_given_by_name_and_a_logs_place_is_unknown() -> None:
    world = WorldConfig(rooms=(Room(name="kitchen", corner=(2.0, 3.0), size=(4.0, 5.0)),))
    rooms = WorldRooms(world=world).step(Context("rooms")).rooms
    assert rooms.names == ("kitchen",)
    assert rooms.corners.tolist() == [[2.0, 3.0, 6.0, 8.0]]
    assert WorldRooms(world=world, log="drive.mcap").step(Context("rooms")).rooms is None
    assert bool(DEMO.rooms) == (WorldRooms().step(Context("rooms")).rooms is not None)

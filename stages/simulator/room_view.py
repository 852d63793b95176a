"""The image of a room: what a robot's camera sees in its middle."""

import numpy as np

from omninav.stages.recordings.recording import UnreadableRecording
from omninav.stages.values.image import Pixels

from .config import WorldConfig
from .robot_camera import RobotCamera
from .standing_room import standing_room, within
from .world import World


def room_view(world: WorldConfig, name: str) -> Pixels:
    """The image (rows, columns, 3) taken on day 0 where the robot has room, closest to the middle of a named room.

    Raises `UnreadableRecording` where there is no such room, or none in it for the robot.
    """
    built = World(world)
    room = next((room for room in built.config.rooms if room.name == name), None)
    places = np.empty((0, 2)) if room is None else within(standing_room(built.config), room)
    if room is None or not len(places):
        raise UnreadableRecording(f"goal: world '{world.name}' has no room for the robot in '{name}'; type another one")
    off = places - np.add(room.corner, np.divide(room.size, 2.0))
    pose = np.append(places[np.argmin(np.hypot(*off.T))], 0.0)
    return RobotCamera(built.config, "goal", 0).image(built.scene, pose[None], 0.0, 0)

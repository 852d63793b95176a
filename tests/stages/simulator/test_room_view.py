"""Images of rooms: where they are taken."""

from dataclasses import replace

import numpy as np
import pytest

from omninav.stages.recordings.recording import UnreadableRecording
from omninav.stages.simulator.config import Block, Door, Room, WorldConfig, mirror
from omninav.stages.simulator.robot_camera import RobotCamera
from omninav.stages.simulator.room_view import room_view
from omninav.stages.simulator.world import World

TABLE = Block((2.0, 3.0), (1.0, 1.0), 0.7)
WORLD = WorldConfig(
    size=(9.0, 6.0),
    camera=mirror(columns=32),
    rooms=(
        Room("kitchen", (0.0, 0.0), (4.0, 6.0), doors=(Door("east", 1.5, 1.2),)),
        Room("cupboard", (5.0, 1.0), (0.5, 0.5)),
    ),
)


def seen_from(world, x, y):
    return RobotCamera(world, "goal", 0).image(World(world).scene, np.array([[x, y, 0.0]]), 0.0, 0)


def test_an_image_is_taken_in_the_middle_of_its_room():
    taken = room_view(WORLD, "kitchen")
    spots = ((1.95, 2.95), (1.0, 1.5), (7.0, 3.0))
    near = [np.abs(taken.astype(int) - seen_from(WORLD, *spot)).mean() for spot in spots]
    assert near[0] < min(near[1:]) / 2


def test_it_is_taken_beside_what_stands_in_the_middle():
    world = replace(WORLD, blocks=(TABLE,))
    assert not np.array_equal(room_view(world, "kitchen"), seen_from(world, 1.95, 2.95))


def test_a_room_that_the_robot_does_not_fit_in_is_named():
    with pytest.raises(UnreadableRecording, match="no room for the robot in 'cupboard'"):
        room_view(WORLD, "cupboard")

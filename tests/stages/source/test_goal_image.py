"""Image files as goals: which are read, and what is said of the others."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
from made_rings import ring_picture
from world_files import DEMO

from omninav.pipeline import Context
from omninav.pipeline.graph.problems import BadInput
from omninav.stages.plots.image_file import ImageFile
from omninav.stages.simulator.config import Door, Room, WorldConfig, mirror
from omninav.stages.simulator.world_rooms import rooms_of
from omninav.stages.source.goal_image import GoalImage
from omninav.stages.values.image import Image

WORLD = replace(DEMO, camera=mirror(columns=16))
PIXELS = np.random.default_rng(0).integers(0, 255, (12, 16, 3)).astype(np.uint8)


def test_an_image_that_was_written_is_read_again_pixel_by_pixel_with_the_robots_camera(tmp_path):
    ImageFile().step(Context("picture_file", folder=tmp_path), [Image(PIXELS), Image(255 - PIXELS)])
    stage = GoalImage(goal=str(tmp_path / "image.png"), world=WORLD)
    found = stage.step(Context("goal_picture"))
    assert found.image is not None
    assert found.image.pixels.tolist() == PIXELS.tolist()
    assert (found.camera.width, found.camera.height_px) == (16, 12)
    assert stage.inputs_digest() is not None


def test_the_camera_of_a_goal_may_be_a_projection_by_its_name(tmp_path):
    file = str(tmp_path / "goal.png")
    cv2.imwrite(file, ring_picture((79.5, 59.5), 58, 9, seed=0, size=(160, 120)))
    found = GoalImage(goal=file, world=None, camera="donut").step(Context("goal"))
    assert found.camera.ring == pytest.approx((79.5, 59.5, 9.0, 58.0), abs=4.0)
    cv2.imwrite(file, np.full((120, 160, 3), 90, np.uint8))
    with pytest.raises(BadInput, match="goal: no ring of a mirror is found in the image; give centre and mask"):
        GoalImage(goal=file, world=None, camera="donut").step(Context("goal"))


@pytest.mark.parametrize("goal", [3, "3", "kitchen", "png"])
def test_a_place_is_no_image(goal):
    stage = GoalImage(goal=goal, world=WORLD, map="saved.omap")
    assert stage.step(Context("goal_picture")).image is None
    assert stage.inputs_digest() is None


@pytest.mark.parametrize("content", [b"", b"not an image"])
def test_a_file_that_is_no_image_is_refused(tmp_path, content):
    (tmp_path / "kitchen.jpg").write_bytes(content)
    with pytest.raises(BadInput, match=r"goal: .*kitchen\.jpg cannot be read as an image"):
        GoalImage(goal=str(tmp_path / "kitchen.jpg"), world=WORLD).step(Context("goal_picture"))


def test_an_image_of_another_camera_is_refused(tmp_path):
    cv2.imwrite(str(tmp_path / "kitchen.png"), PIXELS[:6])
    with pytest.raises(BadInput, match=r"has 16 x 6 pixels, and the robot's camera takes 16 x 12"):
        GoalImage(goal=str(tmp_path / "kitchen.png"), world=WORLD).step(Context("goal_picture"))


ROOMS = replace(WORLD, rooms=(Room("kitchen", corner=(0.0, 0.0), size=(3.0, 3.0)), Room("", (3.0, 0.0), (3.0, 3.0))))


ROOM_OR_IMAGE = {"world": ROOMS, "places": False}


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"goal": None}, "no goal is named; type goal=PLACE"),
        ({"goal": " "}, "no goal is named; type goal=PLACE"),
        ({"goal": "no/kitchen.png"}, r"goal: there is no file .*kitchen\.png; give an image, or a place"),
        ({"goal": "kichen", "world": ROOMS}, r"no place 'kichen'; type goal=kitchen, or .* \(its names are kitchen\)"),
        ({"goal": "kitchen"}, r"no place 'kitchen'; type goal=0, or a place's number \(its places have no names\)"),
        ({"goal": None} | ROOM_OR_IMAGE, r"no goal is named; type goal=ROOM, or goal=IMAGE\.png"),
        ({"goal": "3"} | ROOM_OR_IMAGE, r"no place .3.; type goal=kitchen, or goal=IMAGE\.png"),
        ({"goal": "/goal_pose"}, "goal: /goal_pose is for a live robot"),
        ({"goal": None, "world": None}, r"no goal is named; type .*, or goal=/goal_pose to wait for one"),
        ({"goal": "kitchen", "world": None, "places": False}, "goal: kitchen is no image, and the map has no places"),
    ],
)
def test_what_can_be_no_goal_is_said_before_anything_runs(given, said):
    with pytest.raises(BadInput, match=said):
        GoalImage(**{"world": WORLD, **given}).inputs_digest()


def test_a_live_robot_may_wait_for_its_goal():
    assert GoalImage(goal="/goal_pose").inputs_digest() is None
    assert GoalImage(goal="/goal_pose", places=False).step(Context("goal")).image is None


def test_a_name_that_a_place_may_have_is_left_to_the_map():
    assert GoalImage(goal="kitchen", world=ROOMS).inputs_digest() is None
    assert GoalImage(goal="kichen", world=ROOMS, map="saved.omap").inputs_digest() is None
    assert GoalImage(goal="kichen").inputs_digest() is None


def test_without_places_a_room_is_the_image_that_the_simulated_robot_takes_there():
    kitchen = Room("kitchen", (0.0, 0.0), (4.0, 6.0), doors=(Door("east", 1.5, 1.2),))
    stage = GoalImage(goal="kitchen", world=WorldConfig(camera=mirror(columns=16), rooms=(kitchen,)), places=False)
    found = stage.step(Context("goal"))
    assert found.image is not None
    assert found.image.pixels.shape == (12, 16, 3)
    assert stage.inputs_digest() is not None


def test_the_rooms_of_the_log_that_the_map_is_learned_from_are_its_names(monkeypatch):
    monkeypatch.setattr("omninav.stages.simulator.world_rooms.rooms_of_log", lambda log: rooms_of(ROOMS))
    assert GoalImage(goal="kitchen", world=WORLD, tour="tour.mcap").inputs_digest() is None
    with pytest.raises(BadInput, match="no place 'kichen'"):
        GoalImage(goal="kichen", world=WORLD, tour="tour.mcap").inputs_digest()

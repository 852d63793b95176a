import dataclasses
import math

import numpy as np
import pytest
from turned_robot import CAMERA, look

from omninav.stages.camera.dual_fisheye import DualFisheye
from omninav.stages.camera.rays import unit_vectors
from omninav.stages.camera.unified import Unified
from omninav.stages.features.prepared_image import prepared_image
from omninav.stages.values.image import Image, Panorama


@pytest.mark.parametrize(("columns", "rows", "most"), [(701, 97, 10_000), (640, 480, 50_000), (360, 11, 900)])
def test_a_smaller_image_covers_the_original_from_edge_to_edge(columns: int, rows: int, most: int) -> None:
    read = prepared_image(Panorama(np.zeros((rows, columns, 3), np.uint8)), None, most)
    small = np.array(read.pixels.shape[1::-1])
    assert small.prod() < 1.1 * most
    assert read.scale == pytest.approx(np.array([columns, rows]) / small)
    corners = np.array([[-0.5, -0.5], small - 0.5])
    assert read.original(corners) == pytest.approx(np.array([[-0.5, -0.5], [columns - 0.5, rows - 0.5]]))


def test_a_smaller_mirror_image_has_its_ring_where_the_mirror_is() -> None:
    read = prepared_image(look("mirror", 0.0), CAMERA, 40_000)
    assert read.ring is not None
    middle = np.array([read.ring.centre_x, read.ring.centre_y])
    assert read.original(middle) == pytest.approx([CAMERA.centre_x, CAMERA.centre_y])
    assert read.ring.outer * read.scale == pytest.approx(np.full(2, CAMERA.outer_radius_px), rel=0.01)
    assert read.seen.mean() == pytest.approx(prepared_image(look("mirror", 0.0), CAMERA, 10**6).seen.mean(), abs=0.01)


def test_a_small_image_stays_as_it_is() -> None:
    image = Image(np.random.default_rng(0).integers(0, 255, (480, 640, 3)).astype(np.uint8))
    read = prepared_image(image, dataclasses.replace(CAMERA), 480 * 640)
    assert read.pixels is image.pixels
    assert read.scale.tolist() == [1.0, 1.0]
    points = np.array([[3.0, 4.5]])
    assert (read.original(points) == points).all()


@pytest.mark.parametrize(("looks", "up"), [("down", [0.0, 90.0]), ("up", [180.0, 270.0])])
def test_up_is_outwards_under_a_mirror_and_inwards_through_a_lens_that_looks_up(looks: str, up: list[float]) -> None:
    camera = Unified(320, 240, 145.0, 145.0, 160.0, 120.0, 0.9, (-0.1, 0.0, 0.0, 0.0), looks=looks, yaw=0.3)
    read = prepared_image(Image(np.zeros((240, 320, 3), np.uint8)), camera, 10**6)
    assert read.upward(np.array([[200.0, 120.0], [160.0, 160.0]])) == pytest.approx(np.array(up))


def test_in_two_fisheyes_side_by_side_up_is_where_the_camera_shows_it_and_what_they_do_not_show_is_not_seen() -> None:
    camera = dataclasses.replace(DualFisheye.of_size(640, 320), ahead_roll=0.3)
    read = prepared_image(Image(np.zeros((320, 640, 3), np.uint8)), camera, 160 * 320)
    rays = unit_vectors(np.radians([0.0, 60.0, -60.0, 0.0]), np.radians([0.0, 40.0, 40.0, -40.0]))
    points = (camera.project(rays)[0] + 0.5) / read.scale - 0.5
    # Straight ahead, up is the roll off the column; a meridian leans towards the lens's axis where it is above it.
    off = (read.upward(points) - (270.0 + math.degrees(0.3)) + 180.0) % 360.0 - 180.0
    assert off[[0, 3]] == pytest.approx(0.0, abs=1e-3)
    assert off[1] == pytest.approx(-off[2])
    assert off[1] > 20.0
    assert (read.seen == camera.mask()[::2, ::2]).mean() > 0.99
    assert not read.seen[:, [0, -1]].any()

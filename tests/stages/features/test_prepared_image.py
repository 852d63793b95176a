import dataclasses

import numpy as np
import pytest
from turned_robot import CAMERA, look

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

"""Cameras from the corners of a checkerboard, projected through cameras that are known."""

import numpy as np
import pytest
from made_boards import COLUMNS, LENS, MIRROR, ROWS, seen, worst_deg

from omninav.pipeline import BadInput
from omninav.stages.camera.model import Camera
from omninav.stages.unwarp.checkerboard_calibration import board_points, calibrated


@pytest.mark.parametrize(("projection", "true"), [("hyperbolic", MIRROR), ("ocamcalib", MIRROR), ("fisheye", LENS)])
def test_exact_corners_give_the_camera_back(projection: str, true: Camera) -> None:
    ring = true.ring._replace(centre_x=330.0, centre_y=230.0)
    elevation = 0.4 if projection == "fisheye" else -0.1
    found = calibrated(projection, (640, 480), ring, seen(true, elevation), board_points(COLUMNS, ROWS))
    assert found.rms_px.max() < 0.05
    assert worst_deg(found.camera, true) < 0.1


def test_one_board_that_is_wrong_does_not_bend_the_camera() -> None:
    corners = seen(MIRROR, -0.1)
    corners[2] = corners[2] + np.random.default_rng(0).normal(0, 6.0, corners[2].shape)
    found = calibrated("hyperbolic", (640, 480), MIRROR.ring, corners, board_points(COLUMNS, ROWS))
    assert np.argmax(found.rms_px) == 2
    assert worst_deg(found.camera, MIRROR) < 0.5


def test_two_boards_are_too_few() -> None:
    with pytest.raises(BadInput, match="at least 3 are needed"):
        calibrated("hyperbolic", (640, 480), MIRROR.ring, seen(MIRROR, -0.1)[:2], board_points(COLUMNS, ROWS))

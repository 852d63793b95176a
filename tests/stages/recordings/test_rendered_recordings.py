"""The recordings that the repository brings, as a user opens them."""

import cv2
import numpy as np
import pytest
from conftest import DRIVE, GRID, RECORDINGS, TOUR
from turned_views import columns_moved

from omninav.stages.camera.hyperbolic import HyperbolicMirror
from omninav.stages.geometry.plane.se2 import wrap
from omninav.stages.recordings.occupancy_grid import FREE, read_occupancy
from omninav.stages.recordings.opening import open_recording


@pytest.mark.parametrize(("path", "images"), [(TOUR, 74), (DRIVE, 51)], ids=["tour", "drive"])
def test_every_image_of_a_log_has_a_pose_in_the_free_space_of_the_grid(path, images):
    recording = open_recording(str(path))
    assert len(recording.stamps) == images
    assert not recording.dropped
    assert isinstance(recording.camera, HyperbolicMirror)
    assert recording.image(images - 1).shape == (recording.camera.height_px, recording.camera.width, 3)
    grid = read_occupancy(GRID)
    assert (grid.cells[tuple(grid.cells_of(recording.truth).T)] == FREE).all()


def test_odometry_is_of_the_same_drive_but_drifts():
    recording = open_recording(str(DRIVE))
    steps = [np.hypot(*np.diff(poses[:, :2], axis=0).T).sum() for poses in (recording.truth, recording.odometry)]
    assert steps[1] == pytest.approx(steps[0], rel=0.05)
    assert not np.allclose(recording.odometry - recording.odometry[0], recording.truth - recording.truth[0], atol=0.01)


def test_the_folder_of_panoramas_is_the_drive_with_another_camera():
    folder, log = open_recording(str(RECORDINGS / "images")), open_recording(str(DRIVE))
    number = len(folder.stamps)
    assert number == 26
    assert not folder.dropped
    assert np.abs(folder.stamps - log.stamps[:number]).max() < 1_000_000
    np.testing.assert_allclose(folder.truth[:, :2], log.truth[:number, :2], atol=1e-4)
    np.testing.assert_allclose(wrap(folder.truth[:, 2] - log.truth[:number, 2]), 0.0, atol=1e-4)
    assert folder.odometry is None
    assert folder.image(0).shape == (60, 240, 3)


def test_panoramas_turn_against_the_robot():
    recording = open_recording(str(RECORDINGS / "images"))
    grey = [cv2.cvtColor(recording.image(n), cv2.COLOR_BGR2GRAY) for n in range(len(recording.stamps))]
    moved = columns_moved(np.array(grey))  # columns clockwise: a turn to the left moves them right
    turned = np.degrees(wrap(np.diff(recording.truth[:, 2])))
    assert np.abs(turned).max() > 20.0
    assert np.median(np.abs(moved * 1.5 - turned)) < 1.5  # one column
    assert np.corrcoef(moved, turned)[0, 1] > 0.7

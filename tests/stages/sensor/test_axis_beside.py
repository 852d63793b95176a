"""The axis of a camera, found by landmarks that a shifted one shows from many places of a room."""

from dataclasses import replace

import numpy as np
import pytest

from omninav.stages.camera.equirectangular import Equirectangular
from omninav.stages.camera.hyperbolic import HyperbolicMirror
from omninav.stages.camera.model import Camera
from omninav.stages.camera.self_calibration import leaning
from omninav.stages.geometry.landmarks.adjustment import rotations_about
from omninav.stages.sensor.axis_beside import AxisBeside

MIRROR = HyperbolicMirror(640, 480, 497.0, 497.0, 319.5, 239.5, 28.095, 23.4125, 34.0, 238.0, yaw=0.3)
SHIFT = (-1.2, 1.6)
SIGMA = 0.002


def found(camera: Camera, shift: tuple[float, float] = SHIFT, images: int = 30, tilt: float = 0.0, landmarks: int = 80):
    """Images of a camera whose axis is beside its description, with bearings off by a tenth of a degree."""
    rng, axis = np.random.default_rng(0), AxisBeside()
    real = camera
    if isinstance(camera, HyperbolicMirror):
        real = replace(camera, centre_x=camera.centre_x + shift[0], centre_y=camera.centre_y + shift[1])
    points = rng.uniform([-4.0, -4.0, -0.8], [4.0, 4.0, 1.5], (400, 3))
    for pose in rng.uniform([-2.0, -2.0, -3.0], [2.0, 2.0, 3.0], (images, 3)):
        rays = (points - [pose[0], pose[1], 0.01]) @ rotations_about(pose[2:], 2)[0]
        rays += rng.normal(0.0, SIGMA, rays.shape) * np.linalg.norm(rays, axis=1)[:, None]
        pixels, shown = real.project(leaning(rays, *rng.normal(0.0, 1.0, 2) * tilt))
        rows = np.flatnonzero(shown)[:landmarks]
        described = camera.unproject(pixels[rows])[0]
        about = pose + rng.normal(0.0, 0.02, 3)
        axis = axis.seen(camera, pixels[rows], described, points[rows], about, 2.0 * SIGMA**2)
    return axis, pixels[rows], described, real


@pytest.mark.parametrize("tilt", [0.0, 0.02])
def test_the_axis_is_found_from_places_and_tilts_that_are_known_roughly(tilt: float) -> None:
    axis, pixels, described, real = found(MIRROR, tilt=tilt)
    assert axis.distance() == pytest.approx(SHIFT, abs=0.15)
    right = real.unproject(pixels)[0]
    corrected = axis.bearings(MIRROR, pixels, described)
    assert np.abs(corrected - right).max() < 0.2 * np.abs(described - right).max()


def test_an_axis_where_it_is_described_is_left_there() -> None:
    axis, pixels, described, _ = found(MIRROR, (0.0, 0.0))
    assert axis.images > 20.0
    assert np.linalg.norm(np.linalg.solve(axis.square, axis.slope)) < 0.15
    assert axis.bearings(MIRROR, pixels, described) is described


def test_a_small_distance_or_one_image_does_not_count_and_old_images_count_less_than_new_ones() -> None:
    small = (-0.3, 0.3)
    assert not found(MIRROR, small, images=200)[0].distance().any()
    assert not found(MIRROR, images=1, landmarks=30)[0].distance().any()
    assert found(MIRROR, images=200)[0].images == pytest.approx(50.0, rel=0.05)


def test_cameras_without_an_axis_few_landmarks_and_unwarped_images_show_nothing() -> None:
    sphere = Equirectangular(720, 180, 360.0, elevation_top=0.7, elevation_bottom=-0.7)
    assert found(sphere, (0.0, 0.0))[0].images == 0.0
    assert found(MIRROR, landmarks=19)[0].images == 0.0
    axis, pixels, described, _ = found(MIRROR)
    points = np.ones((len(pixels), 3))
    assert axis.seen(MIRROR, pixels + 1.0, described, points, np.zeros(3), 1e-6) is axis

"""Checks of a camera model: a pixel that is shown looks along the ray that it was projected from."""

import numpy as np
import pytest

from omninav.stages.camera.model import Camera
from omninav.stages.camera.rays import unit_vectors


def assert_round_trip(camera: Camera, azimuth: float, elevation: float) -> None:
    """A ray that the image shows comes back from its pixel, and only pixels of the image show anything."""
    ray = unit_vectors(azimuth, elevation)
    pixel, shown = camera.project(3.7 * ray)
    if not shown:
        return
    assert (pixel >= -0.5).all()
    assert (pixel <= (camera.width - 0.5, camera.height_px - 0.5)).all()
    back, looks = camera.unproject(pixel)
    assert looks
    assert back == pytest.approx(ray, abs=1e-7)


def assert_mask(camera: Camera) -> None:
    """The pixels that the mask names are those that their own rays lead back to."""
    grid, mask = camera.grid(), camera.mask()
    assert mask.shape == (camera.height_px, camera.width)
    assert mask.any()
    rays, looks = camera.unproject(grid)
    assert not mask[~looks].any()
    assert np.isfinite(rays[mask]).all()
    pixels, _ = camera.project(rays[mask])
    np.testing.assert_allclose(pixels, grid[mask], atol=1e-6)

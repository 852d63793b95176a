"""Colour correlations against numpy's, and what they do not change with."""

import numpy as np
import pytest

from omninav.stages.features.colour_moments import disc_colours, image_colours

RNG = np.random.default_rng(5)
PIXELS = (RNG.integers(0, 60, (40, 50, 3)) + RNG.integers(0, 60, (40, 50, 1))).astype(np.uint8)
ALL = np.ones((40, 50), np.bool_)


def by_numpy(pixels: np.ndarray) -> np.ndarray:
    of = np.corrcoef(pixels.reshape(-1, 3).T.astype(float))
    return np.array([of[2, 1], of[2, 0], of[1, 0]])


def test_of_a_picture_they_are_the_correlations_of_its_channels() -> None:
    assert image_colours(PIXELS, ALL) == pytest.approx(by_numpy(PIXELS), abs=1e-6)
    seen = RNG.random((40, 50)) < 0.5
    assert image_colours(PIXELS, seen) == pytest.approx(by_numpy(PIXELS[seen]), abs=1e-6)


def test_of_a_disc_they_are_those_of_the_pixels_in_it() -> None:
    down, right = np.mgrid[:40, :50]
    for x, y, radius, step in ((20, 15, 6.0, 1), (7, 12, 17.0, 2), (43, 33, 17.0, 2)):  # of a large one every second
        disc = (np.hypot(right - x, down - y) <= radius) & ((right - x) % step == 0) & ((down - y) % step == 0)
        found = disc_colours(PIXELS, ALL, [[x + 0.2, y - 0.1]], [radius])[0]
        assert found == pytest.approx(by_numpy(PIXELS[disc]), abs=1e-6)


def test_scale_and_offset_of_each_channel_do_not_change_them() -> None:
    lit = (PIXELS * (2.0, 1.0, 1.0) + (3, 40, 100)).astype(np.uint8)
    assert image_colours(lit, ALL) == pytest.approx(image_colours(PIXELS, ALL), abs=1e-6)


def test_a_channel_that_does_not_vary_goes_with_nothing() -> None:
    flat = PIXELS.copy()
    flat[..., 1] = 77
    assert image_colours(flat, ALL)[[0, 2]].tolist() == [0.0, 0.0]
    assert disc_colours(flat, ALL, np.empty((0, 2)), np.empty(0)).shape == (0, 3)

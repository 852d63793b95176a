import itertools

import cv2
import numpy as np
import pytest

from omninav.stages.features.hsv_histogram import hsv_histograms
from omninav.stages.features.mean_rgb import mean_colours


def picture(seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).integers(0, 256, (20, 36, 3), dtype=np.uint8)


@pytest.mark.parametrize("segments", [1, 7, 36])
def test_mean_colours_are_the_means_of_their_columns(segments: int) -> None:
    pixels = picture()
    edges = np.round(np.arange(segments + 1) * 36 / segments).astype(int)
    expected = [pixels[:, a:b].reshape(-1, 3).mean(axis=0) for a, b in itertools.pairwise(edges)]
    assert np.allclose(mean_colours(pixels, segments), expected, atol=1e-3)


@pytest.mark.parametrize("joint", [False, True])
def test_grey_segments_compare_by_their_brightness(joint: bool) -> None:
    greys = np.repeat(np.array([20, 30, 200, 250], np.uint8), 9)  # two of the lowest value bin, two of the highest
    pixels = np.repeat(np.tile(greys, (10, 1))[..., None], 3, axis=2)
    histograms = hsv_histograms(pixels, 4, joint=joint, min_saturation=64, min_value=32)
    shared = np.minimum(histograms[:, None], histograms[None]).sum(axis=2)
    assert np.allclose(shared, np.kron(np.eye(2), np.ones((2, 2))))


@pytest.mark.parametrize("joint", [False, True])
@pytest.mark.parametrize(("min_s", "min_v"), [(0, 0), (50, 40)])
def test_histograms_agree_with_counting_by_numpy(joint: bool, min_s: int, min_v: int) -> None:
    pixels = picture(3)
    pixels[:, ::4] //= 64  # some of them nearly black, and some without a hue
    hsv = cv2.cvtColor(pixels, cv2.COLOR_BGR2HSV).reshape(20, 36, 3).astype(int)
    found = hsv_histograms(pixels, 6, joint=joint, min_saturation=min_s, min_value=min_v)
    assert np.allclose(found.sum(axis=1), 1.0, atol=1e-6)  # erratum 20: without it the similarity's bound fails
    for j, histogram in enumerate(found):
        h, s, v = hsv[:, 6 * j : 6 * j + 6].reshape(-1, 3).T
        coloured = (s >= max(1, min_s)) & (v >= max(1, min_v))
        if joint:
            bins = np.bincount(np.where(coloured, h * 16 // 180, 16) * 4 + v * 4 // 256, minlength=68) / len(h)
        else:
            hue = np.bincount(h[coloured] * 16 // 180, minlength=16) / (2 * len(h))
            value = np.bincount(v * 4 // 256, minlength=4) / len(h)
            bins = np.concatenate([hue, (1 - hue.sum()) * value])
        assert np.allclose(histogram, bins, atol=1e-6)


def test_a_rolled_panorama_rolls_the_segments_up_when_the_robot_turns_left() -> None:
    # Erratum 24: a counter-clockwise turn moves the scene to the right, to higher columns and segments.
    pixels = picture(5)
    turned = np.roll(pixels, 4, axis=1)
    assert np.allclose(hsv_histograms(turned, 9), np.roll(hsv_histograms(pixels, 9), 1, axis=0))
    assert np.allclose(mean_colours(turned, 9), np.roll(mean_colours(pixels, 9), 1, axis=0))

import colorsys
import itertools

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
@pytest.mark.parametrize("limits", [(0, 0), (64, 32)])
def test_every_segment_sums_to_one(joint: bool, limits: tuple[int, int]) -> None:
    # Erratum 20: without it the similarity's bound fails.
    histograms = hsv_histograms(picture(), 9, joint=joint, min_saturation=limits[0], min_value=limits[1])
    assert histograms.shape == (9, 68 if joint else 20)
    assert np.allclose(histograms.sum(axis=1), 1.0, atol=1e-6)


def test_every_segment_sums_to_one_where_no_pixel_has_a_hue() -> None:
    grey = np.full((10, 36, 3), 120, np.uint8)
    separate, joint = hsv_histograms(grey, 4), hsv_histograms(grey, 4, joint=True)
    assert np.allclose(separate.sum(axis=1), 1.0)
    assert np.allclose(separate[:, :16], 0.0)  # erratum 22: at S = 0 hue is not defined, so it is not red
    assert np.allclose(joint.sum(axis=1), 1.0)


@pytest.mark.parametrize("joint", [False, True])
def test_grey_segments_compare_by_their_brightness(joint: bool) -> None:
    greys = np.repeat(np.array([20, 30, 200, 250], np.uint8), 9)  # two of the lowest value bin, two of the highest
    pixels = np.repeat(np.tile(greys, (10, 1))[..., None], 3, axis=2)
    histograms = hsv_histograms(pixels, 4, joint=joint, min_saturation=64, min_value=32)
    shared = np.minimum(histograms[:, None], histograms[None]).sum(axis=2)
    assert np.allclose(shared, np.kron(np.eye(2), np.ones((2, 2))))


def test_in_a_joint_histogram_grey_does_not_resemble_noise_of_all_colours() -> None:
    grey, noise = np.full((40, 36, 3), 128, np.uint8), np.random.default_rng(0).integers(0, 256, (40, 36, 3), np.uint8)
    one, other = (hsv_histograms(p, 1, joint=True, min_saturation=64, min_value=32) for p in (grey, noise))
    assert np.minimum(one, other).sum() < 0.1  # only what of the noise is grey itself


@pytest.mark.parametrize("hue", [0.01, 0.2, 0.5, 0.7, 0.97])
def test_a_colour_falls_into_the_bin_of_its_hue(hue: float) -> None:
    red, green, blue = (round(255 * c) for c in colorsys.hsv_to_rgb(hue, 1.0, 0.9))
    pixels = np.full((4, 8, 3), (blue, green, red), np.uint8)
    histogram = hsv_histograms(pixels, 1)[0]
    assert np.argmax(histogram[:16]) == int(hue * 16)
    assert histogram[:16].max() == pytest.approx(0.5)
    assert histogram[19] == pytest.approx(0.5)


@pytest.mark.parametrize("joint", [False, True])
def test_histograms_agree_with_counting_by_numpy(joint: bool) -> None:
    import cv2

    pixels = picture(3)
    hsv = cv2.cvtColor(pixels, cv2.COLOR_BGR2HSV).reshape(20, 36, 3).astype(int)
    for j, histogram in enumerate(hsv_histograms(pixels, 6, joint=joint, min_saturation=50, min_value=40)):
        h, s, v = hsv[:, 6 * j : 6 * j + 6].reshape(-1, 3).T
        coloured = (s >= 50) & (v >= 40)
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

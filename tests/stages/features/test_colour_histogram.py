"""Histograms of any colour space."""

import cv2
import numpy as np
import pytest

from omninav.stages.features.colour_histogram import ColourHistogram, colour_histograms

PIXELS = np.random.default_rng(0).integers(0, 256, (40, 72, 3), dtype=np.uint8)


@pytest.mark.parametrize("space", ["rgb", "lab", "ycrcb", "hsv"])
@pytest.mark.parametrize("joint", [False, True])
def test_each_segment_sums_to_one(space, joint):
    counted = colour_histograms(PIXELS, 12, space, (4, 3, 5), joint)
    assert counted.shape == (12, 60 if joint else 12)
    assert counted.sum(axis=1) == pytest.approx(np.ones(12), abs=1e-6)


def test_separate_histograms_are_those_of_opencv():
    counted = colour_histograms(PIXELS, 6, "rgb", (8, 4, 16))
    for segment in range(6):
        part = PIXELS[:, 12 * segment : 12 * segment + 12]
        peers = [cv2.calcHist([part], [2 - c], None, [n], [0, 256]).ravel() for c, n in enumerate((8, 4, 16))]
        assert counted[segment] == pytest.approx(np.concatenate(peers) / (3 * 480), abs=1e-6)


def test_joint_histograms_are_those_of_opencv():
    counted = colour_histograms(PIXELS, 6, "lab", (4, 4, 4), joint=True)
    lab = cv2.cvtColor(PIXELS, cv2.COLOR_BGR2Lab)
    for segment in range(6):
        part = lab[:, 12 * segment : 12 * segment + 12]
        peer = cv2.calcHist([part], [0, 1, 2], None, [4, 4, 4], [0, 256, 0, 256, 0, 256]).ravel()
        assert counted[segment] == pytest.approx(peer / 480, abs=1e-6)


def test_a_channel_can_be_left_out():
    both = colour_histograms(PIXELS, 6, "ycrcb", (0, 8, 8))
    assert both.shape == (6, 16)
    with pytest.raises(ValueError, match="at least one channel"):
        ColourHistogram(bins=(0, 0, 0))


def test_bins_within_ranges_are_those_of_opencv_and_what_lies_beyond_is_in_the_outer_ones():
    ranges = ((0, 255), (80, 183), (64, 191))
    counted = colour_histograms(PIXELS, 6, "lab", (4, 8, 4), ranges=ranges)
    lab = cv2.cvtColor(PIXELS, cv2.COLOR_BGR2Lab)
    for segment in range(6):
        part = lab[:, 12 * segment : 12 * segment + 12]
        peers = [
            cv2.calcHist([np.clip(part, low, high)], [channel], None, [n], [low, high + 1]).ravel()
            for channel, (n, (low, high)) in enumerate(zip((4, 8, 4), ranges, strict=True))
        ]
        assert counted[segment] == pytest.approx(np.concatenate(peers) / (3 * 480), abs=1e-6)


@pytest.mark.parametrize(("space", "whole"), [("lab", ((0, 255),) * 3), ("hsv", ((0, 179), (0, 255), (0, 255)))])
def test_ranges_of_all_levels_change_nothing(space, whole):
    plain = colour_histograms(PIXELS, 6, space, (5, 8, 0), joint=True)
    np.testing.assert_array_equal(colour_histograms(PIXELS, 6, space, (5, 8, 0), joint=True, ranges=whole), plain)


def test_a_range_that_does_not_go_upwards_is_refused():
    with pytest.raises(ValueError, match=r"ranges: each is \[lowest, highest\]"):
        ColourHistogram(space="lab", ranges=((0, 255), (183, 80), (80, 183)))

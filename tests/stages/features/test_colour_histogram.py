"""Histograms of any colour space."""

import cv2
import numpy as np
import pytest

from omninav.stages.features.colour_histogram import ColourHistogram, colour_histograms

PIXELS = np.random.default_rng(0).integers(0, 256, (40, 72, 3), dtype=np.uint8)


SPACES = {"rgb": cv2.COLOR_BGR2RGB, "lab": cv2.COLOR_BGR2Lab, "hsv": cv2.COLOR_BGR2HSV}


@pytest.mark.parametrize("joint", [False, True])
@pytest.mark.parametrize("space", SPACES)
def test_histograms_of_each_segment_are_those_of_opencv_and_sum_to_one(space, joint):
    bins, tops = (8, 4, 16), [180 if space == "hsv" else 256, 256, 256]
    counted = colour_histograms(PIXELS, 6, space, bins, joint)
    converted = cv2.cvtColor(PIXELS, SPACES[space])
    for segment in range(6):
        part = [converted[:, 12 * segment : 12 * segment + 12]]
        if joint:
            peer = cv2.calcHist(part, [0, 1, 2], None, bins, [0, tops[0], 0, 256, 0, 256]).ravel()
        else:
            channels = zip(bins, tops, strict=True)
            peer = np.concatenate([cv2.calcHist(part, [c], None, [n], [0, top]) for c, (n, top) in enumerate(channels)])
        assert counted[segment] == pytest.approx(peer.ravel() / peer.sum(), abs=1e-6)


def test_a_channel_can_be_left_out():
    every = colour_histograms(PIXELS, 6, "lab", (4, 8, 8))
    assert colour_histograms(PIXELS, 6, "lab", (0, 8, 8)) == pytest.approx(every[:, 4:] * 1.5)


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


def test_a_range_that_does_not_go_upwards_and_a_histogram_of_nothing_are_refused():
    with pytest.raises(ValueError, match=r"ranges: each is \[lowest, highest\]"):
        ColourHistogram(space="lab", ranges=((0, 255), (183, 80), (80, 183)))
    with pytest.raises(ValueError, match="at least one channel"):
        ColourHistogram(bins=(0, 0, 0))

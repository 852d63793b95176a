"""HSV colour histogram per segment of the panorama."""

from typing import Annotated, Literal

import cv2
import numpy as np

from omninav.pipeline import Bounds, Context, Outputs, Stage
from omninav.stages.geometry.arrays import Floats
from omninav.stages.values.features import SegmentHistograms
from omninav.stages.values.image import Panorama, Pixels

from .grey_world import UnderGreyWorld
from .segment_edges import counts_by_segment

HUE_BINS = 16
"""Bins of the hue, as in the paper (Gross & Koenig 2004, section 2)."""


def hsv_histograms(
    pixels: Pixels, segments: int, value_bins: int = 4, joint: bool = False, min_saturation: int = 0, min_value: int = 0
) -> Floats:
    """Histograms of hue and value per segment, each segment's summing to 1: (segments, bins) float32.

    `joint` False: `HUE_BINS` + `value_bins` bins, half of the mass in each part; a pixel whose hue is not defined
    (saturation below `min_saturation` or value below `min_value`, of 255; S = 0 or V = 0 never is) gives its share to
    V. `joint` True: `HUE_BINS` x `value_bins` bins, hue slowest, and behind them `value_bins` for such pixels (spread
    over all hues, grey would resemble noise of all colours). So grey segments compare by value in both: two of one
    value intersect by 1, white and black by 0. OpenCV's hue is 0..179 and circular: bins are equal arcs, of which the
    first starts at red (erratum 22 in docs/papers.md).
    """
    hsv = cv2.cvtColor(pixels, cv2.COLOR_BGR2HSV)
    hue, saturation, value = (np.asarray(channel, np.uint8) for channel in cv2.split(hsv))
    defined = (saturation >= max(1, min_saturation)) & (value >= max(1, min_value))
    hue_bin = np.where(defined, np.take(np.arange(256) * HUE_BINS // 180, hue), HUE_BINS)  # the last one: without a hue
    value_bin = np.take(np.arange(256) * value_bins // 256, value)
    if joint:
        counts = counts_by_segment(hue_bin * value_bins + value_bin, (HUE_BINS + 1) * value_bins, segments)
        return np.asarray(counts / counts.sum(axis=1, keepdims=True), np.float32)
    hues = counts_by_segment(hue_bin, HUE_BINS + 1, segments)[:, :HUE_BINS]
    values = counts_by_segment(value_bin, value_bins, segments)
    total = values.sum(axis=1, keepdims=True)
    # Pixels without a hue take no part of its histogram: their share of the segment's mass stays with V.
    left = 1.0 - 0.5 * hues.sum(axis=1, keepdims=True) / total
    return np.concatenate([0.5 * hues / total, left * values / total], axis=1).astype(np.float32)


class HsvHistogram(UnderGreyWorld, Stage):
    """Describes a panorama by a histogram of hue and brightness per segment.

    Gross & Koenig 2004, section 2. Pixels without a hue count by their value alone. Each segment sums to 1, so that
    intersections are in [0, 1] (erratum 20).
    """

    segments: Annotated[int, Bounds(ge=1)] = 36
    """Equal parts of the panorama."""
    bins: Literal["separate", "joint"] = "separate"
    """The paper's "16 bins for H and 4 bins for V": two histograms (20 bins) or a joint one (64, and 4 for pixels
    without a hue), erratum 22."""
    value_bins: Annotated[int, Bounds(ge=1, le=256)] = 4
    """Bins of the brightness."""
    min_saturation: Annotated[int, Bounds(ge=0, le=255)] = 64
    """Saturation below which a pixel's hue is noise and does not count."""
    min_value: Annotated[int, Bounds(ge=0, le=255)] = 32
    """Brightness below which a pixel's hue does not count."""

    class Out(Outputs):
        """The description of the view."""

        features: SegmentHistograms

    def step(self, ctx: Context, panorama: Panorama) -> Out:
        """Describe one panorama."""
        histograms = hsv_histograms(
            self.constant(panorama.pixels),
            self.segments,
            self.value_bins,
            self.bins == "joint",
            self.min_saturation,
            self.min_value,
        )
        return self.Out(features=SegmentHistograms(histograms))

"""HSV colour histogram per segment of the panorama."""

from typing import Annotated, Literal, cast

import cv2
import numpy as np

from omninav.pipeline import Bounds, Context, Outputs, Stage
from omninav.pipeline.engine.compiled import compiled
from omninav.stages.geometry.arrays import Floats, Ints
from omninav.stages.values.features import SegmentHistograms
from omninav.stages.values.image import Panorama, Pixels

from .grey_world import UnderGreyWorld
from .segment_edges import segment_edges

HUE_BINS = 16
"""Bins of the hue, as in the paper (Gross & Koenig 2004, section 2)."""


@compiled(nogil=True)
def _count(
    hsv: Pixels,
    edges: Ints,
    hue_bin: Ints,
    value_bin: Ints,
    hues: int,
    values: int,
    joint: bool,
    min_saturation: int,
    min_value: int,
) -> Floats:
    segments = len(edges) - 1
    bins = hues * values + values if joint else hues + values
    counts = np.zeros((segments, bins), np.float32)
    hue_counts = np.zeros(hues, np.int64)
    value_counts = np.zeros(values, np.int64)
    joint_counts = np.zeros(hues * values + values, np.int64)
    for j in range(segments):
        hue_counts[:] = 0
        value_counts[:] = 0
        joint_counts[:] = 0
        coloured = 0
        for row in range(hsv.shape[0]):
            for column in range(edges[j], edges[j + 1]):
                h, s, v = hsv[row, column, 0], hsv[row, column, 1], hsv[row, column, 2]
                defined = s >= min_saturation and v >= min_value
                if joint:
                    joint_counts[(hue_bin[h] if defined else hues) * values + value_bin[v]] += 1
                else:
                    value_counts[value_bin[v]] += 1
                    if defined:
                        hue_counts[hue_bin[h]] += 1
                        coloured += 1
        total = hsv.shape[0] * (edges[j + 1] - edges[j])
        if joint:
            for b in range(bins):
                counts[j, b] = joint_counts[b] / total
        else:
            # Pixels without a hue take no part of its histogram: their share of the segment's mass stays with V.
            for b in range(hues):
                counts[j, b] = 0.5 * hue_counts[b] / total
            for b in range(values):
                counts[j, hues + b] = (1.0 - 0.5 * coloured / total) * value_counts[b] / total
    return counts


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
    hsv = cast(Pixels, cv2.cvtColor(pixels, cv2.COLOR_BGR2HSV))
    hue_bin = np.arange(256) * HUE_BINS // 180
    value_bin = np.arange(256) * value_bins // 256
    return _count(
        hsv,
        segment_edges(pixels.shape[1], segments),
        hue_bin,
        value_bin,
        HUE_BINS,
        value_bins,
        joint,
        max(1, min_saturation),
        max(1, min_value),
    )


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
        features: SegmentHistograms

    def step(self, ctx: Context, panorama: Panorama) -> Out:
        histograms = hsv_histograms(
            self.constant(panorama.pixels),
            self.segments,
            self.value_bins,
            self.bins == "joint",
            self.min_saturation,
            self.min_value,
        )
        return self.Out(features=SegmentHistograms(histograms))

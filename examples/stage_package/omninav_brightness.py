"""Views described by how bright they are: a template for stages of one's own."""

from typing import Annotated

import numpy as np

from omninav import Bounds, Context, Outputs, Stage
from omninav.stages.values.features import SegmentHistograms
from omninav.stages.values.image import Panorama


class BrightnessHistogram(Stage):
    """Histogram of brightness in each segment of the panorama."""

    segments: Annotated[int, Bounds(ge=1)] = 36
    """Equal parts into which the panorama is divided around the circle."""
    bins: Annotated[int, Bounds(ge=2, le=256)] = 16
    """Levels of brightness that are told apart."""

    class Out(Outputs):
        """`features`: each segment's histogram sums to 1."""

        features: SegmentHistograms

    def step(self, ctx: Context, panorama: Panorama) -> Out:
        """Describe one view."""
        levels = panorama.pixels.mean(axis=2).astype(np.int64) * self.bins // 256
        parts = np.array_split(levels, self.segments, axis=1)
        counts = np.stack([np.bincount(part.ravel(), minlength=self.bins) for part in parts])
        return self.Out(features=SegmentHistograms((counts / counts.sum(axis=1, keepdims=True)).astype(np.float32)))

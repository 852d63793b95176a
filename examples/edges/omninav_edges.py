"""Edge directions per segment, which do not change with the colour of the light."""

from typing import Annotated

import cv2
import numpy as np

from omninav.pipeline import Bounds, Context, Outputs, Stage
from omninav.stages.values.features import SegmentHistograms
from omninav.stages.values.image import Panorama


class EdgeHistogram(Stage):
    """Histogram of edge directions per segment of the panorama, each edge weighted by its strength."""

    segments: Annotated[int, Bounds(ge=1)] = 36
    """Equal parts into which the panorama is divided around the circle."""

    directions: Annotated[int, Bounds(ge=2)] = 20
    """Bins of a histogram over the full circle of edge directions."""

    class Out(Outputs):
        features: SegmentHistograms

    def step(self, ctx: Context, panorama: Panorama) -> Out:
        grey = cv2.cvtColor(panorama.pixels, cv2.COLOR_BGR2GRAY).astype(np.float32)
        strength, angle = cv2.cartToPolar(cv2.Sobel(grey, cv2.CV_32F, 1, 0), cv2.Sobel(grey, cv2.CV_32F, 0, 1))
        direction = (angle * (self.directions / (2 * np.pi))).astype(int) % self.directions
        segment = np.arange(grey.shape[1]) * self.segments // grey.shape[1]
        bins = direction + self.directions * segment  # columns broadcast over rows
        counts = np.bincount(bins.ravel(), strength.ravel(), self.segments * self.directions) + 1e-6
        histograms = counts.reshape(self.segments, self.directions)
        return self.Out(features=SegmentHistograms((histograms / histograms.sum(1, keepdims=True)).astype(np.float32)))

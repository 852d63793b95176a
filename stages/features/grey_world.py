"""Colour constancy by the grey-world assumption, before colours are counted."""

from dataclasses import dataclass
from typing import Literal, cast

import cv2
import numpy as np

from omninav.pipeline.engine.compiled import compiled
from omninav.stages.geometry.arrays import Array, Floats
from omninav.stages.values.image import Pixels

GreyWorld = Literal["none", "whole", "local"]

LEVEL = 128.0
"""The mean to which channels are scaled, of 0..255."""

LOCAL_WINDOW = 0.25
"""Width of the window of `local`, as a share of the circle: 90 degrees (docs/experiments/light.md)."""

MIN_MEAN = 1.0
"""Means below this (0..255) are of a black part, which stays black."""


@compiled(nogil=True)
def _scaled(pixels: Pixels, gains: Floats) -> Pixels:
    out = np.empty_like(pixels)
    for row in range(pixels.shape[0]):
        for column in range(pixels.shape[1]):
            for channel in range(3):
                value = pixels[row, column, channel] * gains[column, channel] + np.float32(0.5)
                out[row, column, channel] = np.uint8(min(value, np.float32(255)))
    return out


def grey_world_pixels(pixels: Pixels, window: float) -> Pixels:
    """Scale each channel so that its mean becomes 128: (rows, columns, 3) uint8.

    The mean is taken around each column over `window`, a share of the circle (1: the whole view, one gain per channel).
    Buchsbaum 1980: where the mean reflectance of a scene is grey, its mean colour is that of the light. In a window it
    also takes away light that comes from one side. What exceeds 255 is cut.
    """
    columns = pixels.shape[1]
    means = cast(Array, cv2.reduce(pixels, 0, cv2.REDUCE_AVG, dtype=cv2.CV_64F)[0])
    half = min(round(window * columns), columns) // 2
    if 2 * half + 1 >= columns:
        around = np.broadcast_to(means.mean(axis=0), means.shape)
    else:
        circle = np.concatenate([means[columns - half :], means, means[: half + 1]])
        sums = np.concatenate([np.zeros((1, 3)), np.cumsum(circle, axis=0)])
        around = (sums[2 * half + 1 : 2 * half + 1 + columns] - sums[:columns]) / (2 * half + 1)
    gains = (LEVEL / np.maximum(around, MIN_MEAN)).astype(np.float32)
    scaled: Pixels = _scaled(np.ascontiguousarray(pixels), gains)
    return scaled


@dataclass(kw_only=True, eq=False)
class UnderGreyWorld:
    """The parameter of stages that count a panorama's colours: a mixin, beside `Stage`."""

    grey_world: GreyWorld = "none"
    """Scale blue, green and red to one mean before they are counted, so that exposure and the colour of the light do
    not count: over the `whole` view, or in a window of 90 degrees around each column (`local`), which also removes
    light from one side."""

    def constant(self, pixels: Pixels, circle: bool = True) -> Pixels:
        """The pixels as they are described: (rows, columns, 3) uint8. `circle` False: an image of one direction."""
        if self.grey_world == "none":
            return pixels
        return grey_world_pixels(pixels, LOCAL_WINDOW if self.grey_world == "local" and circle else 1.0)

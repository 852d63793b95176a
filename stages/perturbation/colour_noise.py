"""Covers parts of the panorama by colour noise, a synthetic occlusion."""

from typing import Annotated

import numpy as np

from omninav.pipeline import Bounds, Context, Outputs, Stage
from omninav.stages.geometry.arrays import Bools, Ints
from omninav.stages.values.image import Panorama

PATTERN = 0
"""Number from which, with the frame's, parts and noise follow: all repetitions see the same images."""
WIDTH_DEG = 40.0
"""Mean width of a segment, degrees."""
MEAN = 128.0
"""Mean of each pixel's blue, green and red, 0 to 255."""
SIGMA = 64.0
"""Their standard deviation."""


def random_parts(rng: np.random.Generator, whole: int, parts: int) -> Ints:
    """Split `whole` at random into `parts` integers >= 0, all splits equally likely: (parts,).

    A row of `whole` items and `parts` - 1 bars between them: each choice of the bars' positions is one split.
    """
    bars = np.sort(rng.choice(whole + parts - 1, size=parts - 1, replace=False))
    return np.diff(np.concatenate([[-1], bars, [whole + parts - 1]])) - 1


def sectors(rng: np.random.Generator, rows: int, columns: int, share: float, width: float) -> Bools:
    """Full-height sectors around the circle that cover `share` of it exactly: (rows, columns) bool.

    As many as fit with a mean width of `width` (a share of the circle); their widths, gaps and place are random.
    """
    covered = round(share * columns)
    number = max(1, round(share / width))
    wide, gaps = random_parts(rng, covered, number), random_parts(rng, columns - covered, number)
    starts = np.cumsum(gaps + np.concatenate([[0], wide[:-1]])) + int(rng.integers(columns))
    mask = np.zeros(columns, dtype=np.bool_)
    for start, length in zip(starts, wide, strict=True):
        mask[np.arange(start, start + length) % columns] = True
    return np.broadcast_to(mask, (rows, columns))


class ColourNoise(Stage):
    """Covers a share of the panorama by artificial segments of Gaussian colour noise.

    Gross & Koenig 2004, section 3, occlusion experiments: views are "randomly occluded by artificial image segments
    showing Gaussian-distributed color noise", from 0 to 80 % of the image. The shape of the segments is not given: here
    they are as high as the image, like people close to the camera.
    """

    share: Annotated[float, Bounds(ge=0, le=1)] = 0.4
    """Share of the image that is covered."""

    class Out(Outputs):
        panorama: Panorama

    def step(self, ctx: Context, panorama: Panorama) -> Out:
        if self.share == 0.0:
            return self.Out(panorama=panorama)
        tick = ctx.tick
        rng = np.random.default_rng([PATTERN, tick.log, tick.frame])
        rows, columns = panorama.pixels.shape[:2]
        mask = sectors(rng, rows, columns, self.share, WIDTH_DEG / 360.0)
        pixels = panorama.pixels.copy()
        noise = rng.normal(MEAN, SIGMA, (int(mask.sum()), 3))
        pixels[mask] = np.clip(np.rint(noise), 0, 255).astype(np.uint8)
        return self.Out(panorama=Panorama(pixels, panorama.elevation_top, panorama.elevation_bottom))

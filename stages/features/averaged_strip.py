"""A panorama averaged to a small strip: what transforms of whole views begin with."""

from dataclasses import dataclass
from typing import Annotated, Literal, cast

import cv2
import numpy as np
import numpy.typing as npt

from omninav.pipeline import Bounds, Outputs
from omninav.stages.values.image import Panorama, Pixels
from omninav.stages.values.views import Coefficients

FloatArray = npt.NDArray[np.float32]
Channels = Literal["brightness", "colour"]
Contrast = Literal["none", "whole", "local"]

WINDOW = 1.0 / 18.0
"""Standard deviation of the window of local contrast, as a share of the circle: 20 degrees
(docs/experiments/cml_view_limit.md)."""

FAINT = 5.0
"""Grey levels: what differs by less from its surroundings is rather noise than contrast."""


@dataclass(kw_only=True, eq=False)
class AveragedStrip:
    """What stages that describe a view by its averaged panorama have in common: a mixin, beside `Stage`.

    The panorama is averaged to `rows` x `columns` of brightness or colour (`channels`), in grey levels (`contrast`
    none) or in standard deviations (whole, local: see `averaged_strip`). `headings`, which must divide `columns`: at
    how many turns views are compared; 1 compares them as they are.
    """

    rows: Annotated[int, Bounds(ge=1)] = 16
    columns: Annotated[int, Bounds(ge=1)] = 72
    channels: Channels = "brightness"
    contrast: Contrast = "local"
    headings: Annotated[int, Bounds(ge=1)] = 36

    class Out(Outputs):
        """The description of the view."""

        view: Coefficients

    def __post_init__(self) -> None:
        """Headings are whole columns apart."""
        if self.columns % self.headings:
            raise ValueError(f"headings: {self.headings} do not divide {self.columns} columns; write columns: 72")

    def strip(self, panorama: Panorama) -> FloatArray:
        """One panorama averaged: (rows, columns, channels)."""
        return averaged_strip(panorama.pixels, self.rows, self.columns, self.channels, self.contrast)


def averaged_strip(
    pixels: Pixels, rows: int, columns: int, channels: Channels, contrast: Contrast = "none"
) -> FloatArray:
    """Means over equal parts of a panorama: (rows, columns, 1 or 3) float32. Columns run as the panorama's.

    `brightness`: grey as OpenCV weighs it; `colour`: blue, green, red. `contrast` none: grey levels, 0..255. whole:
    less the channel's mean, over its standard deviation, so that neither exposure nor the lamps' brightness counts.
    local: the same at each place with the mean and deviation of its surroundings, so that shadows and lamps that are
    switched count as little.
    """
    seen = cv2.cvtColor(pixels, cv2.COLOR_BGR2GRAY) if channels == "brightness" else pixels
    small = cv2.resize(seen.astype(np.float32), (columns, rows), interpolation=cv2.INTER_AREA)
    strip = cast(FloatArray, small.reshape(rows, columns, -1))
    match contrast:
        case "none":
            return strip
        case "whole":
            deviation = np.sqrt(strip.var(axis=(0, 1)) + FAINT**2)
            return cast(FloatArray, (strip - strip.mean(axis=(0, 1))) / deviation)
        case "local":
            return local_contrast(strip, WINDOW * columns, WINDOW * pixels.shape[1] * rows / pixels.shape[0])


def local_contrast(strip: FloatArray, across: float, down: float) -> FloatArray:
    """Each value less the mean of its surroundings, over their standard deviation: (rows, columns, channels).

    The surroundings are Gaussian, of `across` columns and `down` rows (standard deviations), and go around the circle.
    """
    columns = strip.shape[1]
    circle = np.concatenate([strip, strip, strip], axis=1)
    gap = circle - _blurred(circle, across, down)
    contrast = gap / np.sqrt(_blurred(gap**2, across, down) + FAINT**2)
    return np.ascontiguousarray(contrast[:, columns : 2 * columns], dtype=np.float32)


def _blurred(strip: FloatArray, across: float, down: float) -> FloatArray:
    return cast(FloatArray, cv2.GaussianBlur(strip, (0, 0), sigmaX=across, sigmaY=down).reshape(strip.shape))


def turned_copies(rows: FloatArray, headings: int) -> FloatArray:
    """Rows (D, P) that run column by column, turned: (headings, D, P).

    A picture projected on turn h of the rows is what a robot turned counter-clockwise by 2 pi h / headings would see,
    projected on the rows themselves: its columns move right, which is the same as rows moved to the left.
    """
    step = rows.shape[1] // headings
    return np.stack([np.roll(rows, -step * heading, axis=1) for heading in range(headings)])

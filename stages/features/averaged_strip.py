"""Averages a panorama to a small strip, the input of transforms of whole views."""

from dataclasses import dataclass
from typing import Annotated, Any, Literal, TypeVar, cast

import cv2
import numpy as np
import numpy.typing as npt

from omninav.pipeline import Bounds, Outputs
from omninav.stages.geometry.arrays import Floats
from omninav.stages.values.image import Panorama, Pixels
from omninav.stages.values.views import Coefficients

Real = TypeVar("Real", bound=np.floating[Any])
Channels = Literal["brightness", "colour"]
Contrast = Literal["none", "local"]

LOCAL_CONTRAST_SIGMA = 1.0 / 18.0
"""Standard deviation of the window of local contrast, as a share of the circle: 20 degrees
(docs/experiments/cml_view_limit.md)."""

NOISE_GREY_LEVELS = 5.0
"""Differences from the surroundings below this are noise rather than contrast."""


@dataclass(kw_only=True, eq=False)
class AveragedStrip:
    """Parameters of stages that describe a view by its averaged panorama: a mixin, beside `Stage`."""

    rows: Annotated[int, Bounds(ge=1)] = 16
    """Rows of the strip."""
    columns: Annotated[int, Bounds(ge=1)] = 72
    """Columns of the strip."""
    channels: Channels = "brightness"
    """`brightness`, or `colour` (blue, green, red)."""
    contrast: Contrast = "local"
    """`none`: grey levels, the papers' form; `local`: standard deviations from the mean of the surroundings (see
    `averaged_strip`)."""
    headings: Annotated[int, Bounds(ge=1)] = 36
    """Headings at which views are compared; must divide `columns`. 1: as they are, the papers' form."""

    class Out(Outputs):
        view: Coefficients

    def __post_init__(self) -> None:
        """Headings are whole columns apart."""
        if self.columns % self.headings:
            raise ValueError(f"headings: {self.headings} do not divide {self.columns} columns; write columns: 72")

    def strip(self, panorama: Panorama) -> Floats:
        """One panorama averaged: (rows, columns, channels)."""
        return averaged_strip(panorama.pixels, self.rows, self.columns, self.channels, self.contrast)


def averaged_strip(pixels: Pixels, rows: int, columns: int, channels: Channels, contrast: Contrast = "none") -> Floats:
    """Average a panorama over equal parts: (rows, columns, 1 or 3) float32, columns as in the panorama.

    `brightness`: grey as OpenCV weighs it; `colour`: blue, green, red. `contrast` none: grey levels, 0..255. local:
    minus the mean of the channel's surroundings, divided by their standard deviation, which removes exposure, shadows
    and switched lamps.
    """
    seen = cv2.cvtColor(pixels, cv2.COLOR_BGR2GRAY) if channels == "brightness" else pixels
    small = cv2.resize(seen.astype(np.float32), (columns, rows), interpolation=cv2.INTER_AREA)
    strip = cast(Floats, small.reshape(rows, columns, -1))
    if contrast == "none":
        return strip
    return local_contrast(
        strip, LOCAL_CONTRAST_SIGMA * columns, LOCAL_CONTRAST_SIGMA * pixels.shape[1] * rows / pixels.shape[0]
    )


def local_contrast(strip: Floats, across: float, down: float) -> Floats:
    """Each value minus the mean of its surroundings, divided by their standard deviation: (rows, columns, channels).

    The surroundings are Gaussian, of `across` columns and `down` rows (standard deviations), and go around the circle.
    """
    columns = strip.shape[1]
    circle = np.concatenate([strip, strip, strip], axis=1)
    gap = circle - _blurred(circle, across, down)
    contrast = gap / np.sqrt(_blurred(gap**2, across, down) + NOISE_GREY_LEVELS**2)
    return np.ascontiguousarray(contrast[:, columns : 2 * columns], dtype=np.float32)


def _blurred(strip: Floats, across: float, down: float) -> Floats:
    return cast(Floats, cv2.GaussianBlur(strip, (0, 0), sigmaX=across, sigmaY=down).reshape(strip.shape))


def turned_copies(rows: npt.NDArray[Real], headings: int) -> npt.NDArray[Real]:
    """Rows (D, P) that run column by column, turned: (headings, D, P).

    An image projected on turn h of the rows is what a robot turned counter-clockwise by 2 pi h / headings would see,
    projected on the rows themselves: its columns move right, which is the same as rows moved to the left.
    """
    step = rows.shape[1] // headings
    return np.stack([np.roll(rows, -step * heading, axis=1) for heading in range(headings)])

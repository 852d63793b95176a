"""Makes a panorama a small grey strip."""

import cv2
import numpy as np

from omninav.pipeline import Context, Outputs, Stage
from omninav.stages.values.image import Panorama, Strip, Windows

COLUMNS = 90
"""Columns of the strip, pixels: 4 degrees each."""
ROWS = 8
"""Rows of the strip, pixels."""


class GreyStrip(Stage):
    """The mean grey of equal parts of a panorama: enough to see turns, and small enough to be kept over a whole log.

    A stage of its own so that it can be cached with the log's other features.
    """

    class Out(Outputs):
        """The strip; absent where the image is not a full circle."""

        strip: Strip | None = None

    def step(self, ctx: Context, panorama: Panorama | Windows) -> Out:
        if isinstance(panorama, Windows):
            return self.Out()
        grey = cv2.cvtColor(panorama.pixels, cv2.COLOR_BGR2GRAY)
        size = (COLUMNS, ROWS)
        small = cv2.resize(grey.astype(np.float32), size, interpolation=cv2.INTER_AREA)
        return self.Out(strip=Strip(np.asarray(small, np.float32)))

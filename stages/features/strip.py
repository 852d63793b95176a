"""A panorama averaged to a small strip: what transforms of whole views begin with."""

from typing import Literal, cast

import cv2
import numpy as np
import numpy.typing as npt

from omninav.stages.values.image import Pixels

FloatArray = npt.NDArray[np.float32]
Channels = Literal["brightness", "colour"]


def averaged_strip(pixels: Pixels, rows: int, columns: int, channels: Channels) -> FloatArray:
    """Means over equal parts of a panorama: (rows, columns, 1 or 3) float32 in 0..255.

    `brightness`: grey as OpenCV weighs it; `colour`: blue, green, red. Columns run as the panorama's.
    """
    seen = cv2.cvtColor(pixels, cv2.COLOR_BGR2GRAY) if channels == "brightness" else pixels
    small = cv2.resize(seen.astype(np.float32), (columns, rows), interpolation=cv2.INTER_AREA)
    return cast(FloatArray, small.reshape(rows, columns, -1))

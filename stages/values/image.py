"""Images: as the camera gave them, as panoramas in one common form, and as perspective windows."""

import math
from typing import Annotated

import numpy as np
import numpy.typing as npt

from omninav.pipeline import Bounds, Shape, Value
from omninav.stages.geometry.arrays import Array, Bools, Floats

Pixels = npt.NDArray[np.uint8]
Elevation = Bounds(ge=-math.pi / 2 - 1e-6, le=math.pi / 2 + 1e-6)
"""Radians above the horizon."""


class Image(Value):
    """An image as the camera gave it. `pixels`: (height, width, 3) uint8, blue-green-red as in OpenCV."""

    bulky = True
    pixels: Annotated[Pixels, Shape("height", "width", 3)]


class Panorama(Value):
    """The full circle around the robot, seen from inside: columns run clockwise, forward is in the middle.

    `pixels`: (rows, columns, 3) uint8, blue-green-red. The centre of column c looks along the azimuth
    `pi - 2 pi (c + 0.5) / columns` (radians, counter-clockwise from the robot's forward), so a robot that turns
    counter-clockwise sees the scene move to the right. `elevation_top` and `elevation_bottom` are the elevations
    of the upper and the lower edge (radians above the horizon), None where the camera's geometry is not known.
    """

    bulky = True
    pixels: Annotated[Pixels, Shape("rows", "columns", 3)]
    elevation_top: Annotated[float | None, Elevation] = None
    elevation_bottom: Annotated[float | None, Elevation] = None


class Strip(Value):
    """A small panorama in grey. `pixels`: (rows, columns) float32, means over equal parts of a `Panorama`."""

    pixels: Annotated[Floats, Shape("rows", "columns")]


class Windows(Value):
    """Perspective images taken at once, each in one direction, level or not.

    `pixels`: (W, rows, columns, 3) uint8, blue-green-red, the scene's left on the left. `headings` (W,): azimuths of
    their optical axes (radians, counter-clockwise from the robot's forward). `field`: horizontal field of view of each
    (radians). `seen` (W, rows, columns): False where the camera they were cut from sees nothing (black); None: all
    is seen.
    """

    bulky = True
    pixels: Annotated[Pixels, Shape("W", "rows", "columns", 3)]
    headings: Annotated[Array, Shape("W")]
    field: Annotated[float, Bounds(gt=0, le=2 * math.pi)]
    seen: Annotated[Bools | None, Shape("W", "rows", "columns")] = None


def column_azimuths(columns: int) -> Array:
    """Azimuths of the column centres of a panorama: (columns,) radians, counter-clockwise from forward."""
    azimuths: Array = math.pi - 2 * math.pi * (np.arange(columns) + 0.5) / columns
    return azimuths

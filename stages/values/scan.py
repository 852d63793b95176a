"""Ranges to what is around the robot."""

from typing import Annotated

import numpy as np

from omninav.pipeline import Bounds, Shape, Value
from omninav.stages.geometry.arrays import Array


class Scan(Value):
    """A ring of range readings. Only obstacle stop and recovery may read it.

    `ranges`: (N,) metres from the robot's middle, infinite where there was no echo. Reading k looks along the azimuth
    `first + k step` (radians, counter-clockwise from the robot's forward). Echoes come from `nearest` to `farthest` m.
    """

    ranges: Annotated[Array, Shape("N", finite=False), Bounds(ge=0)]
    first: float
    step: float
    nearest: Annotated[float, Bounds(ge=0)]
    farthest: Annotated[float, Bounds(ge=0)]

    def azimuths(self) -> Array:
        """Directions of the readings: (N,) radians."""
        azimuths: Array = self.first + self.step * np.arange(len(self.ranges), dtype=np.float64)
        return azimuths

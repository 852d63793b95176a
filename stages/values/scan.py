"""Ranges to what stands around the robot."""

import numpy as np
import numpy.typing as npt

from omninav.pipeline import Value

Array = npt.NDArray[np.float64]


class Scan(Value):
    """A ring of range readings. Only obstacle stop and recovery may read it.

    `ranges`: (N,) metres from the robot's middle, infinite where there was no echo. Reading k looks along the azimuth
    `first + k step` (radians, counter-clockwise from the robot's forward). Echoes come from `nearest` to `farthest` m.
    """

    ranges: Array
    first: float
    step: float
    nearest: float
    farthest: float

    def azimuths(self) -> Array:
        """Where the readings look: (N,) radians."""
        azimuths: Array = self.first + self.step * np.arange(len(self.ranges), dtype=np.float64)
        return azimuths

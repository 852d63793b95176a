"""Other light than when the map was learned: brightness, contrast, colour, and from which side."""

import math
from typing import Annotated

import numpy as np
import numpy.typing as npt

from omninav.pipeline import Bounds, Context, Outputs, Stage
from omninav.stages.values.image import Panorama, Pixels, column_azimuths

Gain = Annotated[float, Bounds(gt=0, le=10)]


def changed_light(
    pixels: Pixels, gamma: float, gains: tuple[float, float, float], side: float, direction: float
) -> Pixels:
    """A panorama in other light: 255 (v / 255)^gamma gain (1 + side cos(azimuth - direction)), cut at 255.

    `pixels` (rows, columns, 3) uint8; `gains`: of blue, green, red; `side` in [0, 1]: share by which light from
    `direction` (radians, counter-clockwise from forward) exceeds the mean.
    """
    curve = 255.0 * (np.arange(256) / 255.0) ** gamma
    around = 1.0 + side * np.cos(column_azimuths(pixels.shape[1]) - direction)
    levels: npt.NDArray[np.float64] = curve[pixels] * np.asarray(gains) * around[:, None]
    return np.rint(np.minimum(levels, 255.0)).astype(np.uint8)


class ChangedLight(Stage):
    """Shows the panorama in other light than the map was learned in.

    The light is fixed to the robot: it turns with it, as a lamp on the robot or its shadow does.
    """

    gamma: Annotated[float, Bounds(gt=0, le=10)] = 1.0
    """Exponent of the levels; above 1 shadows are deeper."""
    gain: Gain = 1.0
    """Factor of all channels: exposure."""
    blue: Gain = 1.0
    """Factor of blue: below 1 with warm lamps."""
    red: Gain = 1.0
    """Factor of red: above 1 with warm lamps."""
    side: Annotated[float, Bounds(ge=0, le=1)] = 0.0
    """Share by which light from one side exceeds the mean."""
    direction_deg: Annotated[float, Bounds(ge=-360, le=360)] = 90.0
    """Direction it comes from, counter-clockwise from forward."""

    class Out(Outputs):
        """The panorama in other light."""

        panorama: Panorama

    def step(self, ctx: Context, panorama: Panorama) -> Out:
        """Change the light of one panorama."""
        gains = (self.gain * self.blue, self.gain, self.gain * self.red)
        pixels = changed_light(panorama.pixels, self.gamma, gains, self.side, math.radians(self.direction_deg))
        return self.Out(panorama=Panorama(pixels, panorama.elevation_top, panorama.elevation_bottom))

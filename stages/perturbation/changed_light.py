"""Other light than when the map was learned: brightness, contrast, colour, and from which side."""

import math
from dataclasses import replace
from functools import lru_cache
from typing import Annotated

import numpy as np

from omninav.pipeline import BadInput, Bounds, Context, Outputs, Stage
from omninav.stages.camera.model import Camera
from omninav.stages.geometry.arrays import Array
from omninav.stages.values.image import Image, Panorama, Pixels, column_azimuths

Gain = Annotated[float, Bounds(gt=0, le=10)]

DIRECTION_DEG = 90.0
"""Direction that light from one side comes from, degrees counter-clockwise from forward."""


def changed_light(
    pixels: Pixels, gamma: float, gains: tuple[float, float, float], side: float, direction: float, azimuths: Array
) -> Pixels:
    """An image in other light: 255 (v / 255)^gamma gain (1 + side cos(azimuth - direction)), cut at 255.

    `pixels` (rows, columns, 3) uint8; `gains`: of blue, green, red; `side` in [0, 1]: share by which light from
    `direction` (radians, counter-clockwise from forward) exceeds the mean; `azimuths` (columns,) or (rows, columns).
    """
    curve = 255.0 * (np.arange(256) / 255.0) ** gamma
    around = 1.0 + side * np.cos(azimuths - direction)
    levels: Array = curve[pixels] * np.asarray(gains) * around[..., None]
    return np.rint(np.minimum(levels, 255.0)).astype(np.uint8)


class ChangedLight(Stage):
    """Shows the image, as it was taken or unwarped, in other light than the map was learned in.

    Local features see images as they were taken: wire those where a graph has any. The light is fixed to the robot: it
    turns with it, as a lamp on the robot or its shadow does.
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
    """Share by which light from the left exceeds the mean."""

    class Out(Outputs):
        """The input in other light."""

        panorama: Panorama | None = None
        image: Image | None = None

    def step(
        self,
        ctx: Context,
        panorama: Panorama | None = None,
        image: Image | None = None,
        camera: Camera | None = None,
    ) -> Out:
        """Change the light of a panorama, or of an image, which needs its camera."""
        if panorama is None and image is None and ctx.tick.first_of_log:
            raise BadInput(
                "changed_light: it is wired to no image, so that light would stay as it is: type "
                "'+wires.perturbation={panorama: unwarp.panorama}' wires.features.panorama=perturbation.panorama"
            )
        out = self.Out()
        if panorama is not None:
            changed = self._changed(panorama.pixels, column_azimuths(panorama.pixels.shape[1]))
            out = replace(out, panorama=replace(panorama, pixels=changed))
        if image is not None:
            if camera is None:
                raise BadInput("changed_light: an image needs its camera: wire camera: source.camera beside it")
            out = replace(out, image=Image(self._changed(image.pixels, _azimuths(camera))))
        return out

    def _changed(self, pixels: Pixels, azimuths: Array) -> Pixels:
        gains = (self.gain * self.blue, self.gain, self.gain * self.red)
        return changed_light(pixels, self.gamma, gains, self.side, math.radians(DIRECTION_DEG), azimuths)


@lru_cache(1)  # of a drive's one camera
def _azimuths(camera: Camera) -> Array:
    rays, _ = camera.unproject(camera.grid())
    azimuths: Array = np.nan_to_num(np.arctan2(rays[..., 1], rays[..., 0]))
    return azimuths

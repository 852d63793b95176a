"""Cuts perspective windows from an omnidirectional image: what ordinary cameras in its place would see."""

import math
from typing import Annotated, cast

import cv2
import numpy as np

from omninav.pipeline import BadInput, Bounds, Context, Outputs, Stage
from omninav.stages.camera.model import Camera, require_elevations
from omninav.stages.camera.perspective import Perspective
from omninav.stages.geometry.arrays import Array
from omninav.stages.geometry.plane.se2 import wrap
from omninav.stages.values.image import Image, Pixels, Windows

from .table import remap_table


def window_rays(heading: float, pitch: float, field: float, columns: int, rows: int) -> Array:
    """Directions (rows, columns, 3) in the robot's frame that the pixels of a perspective image look along.

    `heading` (rad, counter-clockwise from forward) and `pitch` (rad above the horizon) of its optical axis, `field` its
    horizontal field of view (rad). Pixels are square.
    """
    focal = columns / (2.0 * math.tan(field / 2.0))
    right = (np.arange(columns) + 0.5 - columns / 2.0) / focal
    up = (rows / 2.0 - 0.5 - np.arange(rows)) / focal
    ahead = math.cos(pitch) - math.sin(pitch) * up[:, None] + 0.0 * right
    high = math.sin(pitch) + math.cos(pitch) * up[:, None] + 0.0 * right
    left = -right + 0.0 * up[:, None]
    cos, sin = math.cos(heading), math.sin(heading)
    return np.stack([cos * ahead - sin * left, sin * ahead + cos * left, high], axis=-1)


class PerspectiveWindow(Stage):
    """Cuts perspective windows from an omnidirectional image; passes an ordinary camera's image on as it is.

    Wolf, Burgard & Burkhardt 2005, section VI: their robot has ordinary cameras. What the camera does not see is black
    in a window, and counted. An ordinary camera's image is only resized, and shows what it shows. Raises BadInput for a
    camera of which elevations are not known, windows that show nothing, and several `directions` of an ordinary camera.
    """

    directions: Annotated[int, Bounds(ge=1)] = 1
    """Number of windows, evenly around the robot, counter-clockwise from straight ahead; 1: an ordinary camera that
    looks ahead."""
    field_deg: Annotated[float, Bounds(gt=0, lt=180)] = 60.0
    """Horizontal field of view of a window."""
    columns: Annotated[int, Bounds(ge=8)] = 320
    """Columns of a window, of square pixels."""
    rows: Annotated[int, Bounds(ge=1)] = 240
    """Rows of a window."""
    pitch_deg: Annotated[float, Bounds(ge=-90, le=90)] = 0.0
    """Elevation of the windows' optical axes above the horizon."""

    class Out(Outputs):
        """The windows, where other unwarps give a panorama."""

        panorama: Windows

    def setup(self, ctx: Context) -> None:
        """No table yet: the camera comes with the first image."""
        self._camera: Camera | None = None

    def step(self, ctx: Context, image: Image, camera: Camera) -> Out:
        if isinstance(camera, Perspective):
            return self.Out(panorama=self._of_perspective(image, camera))
        headings = wrap(2.0 * math.pi * np.arange(self.directions) / self.directions)
        if camera is not self._camera:
            self._build(ctx, camera, headings)
        cut = self._table.remap(image.pixels)
        cut = cut.reshape(len(headings), self.rows, *cut.shape[1:])
        if self._seen is not None:
            cut[~self._seen] = 0
        return self.Out(panorama=Windows(cut, headings, math.radians(self.field_deg), self._seen))

    def _build(self, ctx: Context, camera: Camera, headings: Array) -> None:
        """Make the remap table of all windows, one below the other, once per camera."""
        size = math.radians(self.pitch_deg), math.radians(self.field_deg), self.columns, self.rows
        require_elevations(camera)
        table, seen = remap_table(camera, np.concatenate([window_rays(float(h), *size) for h in headings]))
        if not seen.any():
            raise BadInput(
                f"unwarp: the camera sees nothing of a window of {self.field_deg:g} deg at {self.pitch_deg:g} deg "
                "above the horizon; set nodes.unwarp.pitch_deg and field_deg"
            )
        dark = 1.0 - float(seen.mean())
        if dark > 0.0:
            ctx.count(
                "windows_beyond_the_camera",
                detail=f"unwarp: {100 * dark:.1f} % of the windows are outside of what the camera sees, and are black; "
                "nodes.unwarp.pitch_deg or a smaller field_deg moves them inside",
            )
        self._seen = None if dark == 0.0 else seen.reshape(len(headings), self.rows, self.columns)
        self._table, self._camera = table, camera

    def _of_perspective(self, image: Image, camera: Perspective) -> Windows:
        if self.directions > 1:
            raise BadInput(
                f"unwarp: an ordinary camera looks one way, not {self.directions}; write nodes.unwarp.directions=1"
            )
        pixels = cast(Pixels, cv2.resize(image.pixels, (self.columns, self.rows), interpolation=cv2.INTER_AREA))
        field = 2.0 * math.atan(camera.width / (2.0 * camera.focal_x))
        return Windows(pixels[np.newaxis], np.array([camera.yaw]), field)

"""Draws what a camera sees, unwarped, with azimuths: whether a camera.yaml is right is best seen."""

import math
from typing import TYPE_CHECKING, Annotated

import cv2
import numpy as np

from omninav.pipeline import BadInput, Bounds, Context, Tool, write_whole
from omninav.pipeline.report.plot_style import PALETTE, plot, plot_file
from omninav.stages.camera.model import Camera
from omninav.stages.camera.rays import angles, turned, unit_vectors
from omninav.stages.recordings.opening import open_recording
from omninav.stages.recordings.recording import Topics
from omninav.stages.unwarp.table import remap_table
from omninav.stages.values.image import Image

if TYPE_CHECKING:
    from matplotlib.axes import Axes

COLUMNS = 1440
"""Columns of the full circle; an ordinary camera's image has as many as its part of it."""


class LookThroughCamera(Tool):
    """Writes one image of a log, unwarped, as a PNG with azimuths and, where they are known, elevations.

    Upright things are upright in it, the horizon is level, and what is ahead of the robot is at 0 degrees, or the
    camera is not as described. Raises BadInput where the log cannot be read.
    """

    example = "log=drive.mp4 camera=camera.yaml out=look.png"

    log: str
    """A log of any kind."""
    camera: str | None = None
    """A camera.yaml, or a projection, in place of the log's own."""
    topics: Topics = Topics()
    """Which topics of the log are read."""
    frame: Annotated[int, Bounds(ge=0)] = 0
    """Which of its images; the next that can be decoded."""
    out: str = "look.png"
    """The file to write."""

    def run(self, ctx: Context) -> None:
        """Unwarp one image and draw it."""
        path = plot_file(self.out)
        recording = open_recording(self.log, self.topics, self.camera)
        frames = range(self.frame, len(recording.stamps))
        frame, pixels = next(((n, found) for n in frames if (found := recording.image(n)) is not None), (0, None))
        if pixels is None:
            raise BadInput(f"{self.log}: no image from number {self.frame} on; it has {len(recording.stamps)}")
        image, camera = Image(pixels), recording.camera
        with plot(12.0, 4.2) as drawn:
            axes = drawn.canvas.subplots()
            draw_panorama(axes, image, camera)
            axes.set_title(f"image {frame} of {self.log}, {camera.projection} camera")
        write_whole(path, drawn.content)
        for sentence in recording.assumed:
            print(f"assumed: {sentence}")
        print(f"{path}: image {frame}, {camera.projection} camera; forward is at 0 degrees")


def field_of_view(camera: Camera) -> tuple[float, float, float, float]:
    """Azimuths of the left and the right edge of all that a camera sees, elevations of the upper and lower (rad)."""
    if camera.elevations is not None:
        return math.pi, -math.pi, *camera.elevations
    rays, looks = camera.unproject(camera.grid())
    azimuths, elevations = angles(turned(rays[looks], -camera.yaw))
    return azimuths.max() + camera.yaw, azimuths.min() + camera.yaw, elevations.max(), elevations.min()


def draw_panorama(axes: "Axes", image: Image, camera: Camera) -> None:
    """Draw an image over azimuth and elevation (degrees), square where elevations are known."""
    left, right, top, bottom = field_of_view(camera)
    columns, rows = (max(8, round(COLUMNS * span / (2.0 * math.pi))) for span in (left - right, top - bottom))
    azimuths = left + (right - left) * (np.arange(columns) + 0.5) / columns
    elevations = top + (bottom - top) * (np.arange(rows) + 0.5) / rows
    pixels = remap_table(camera, unit_vectors(azimuths, elevations[:, None]))[0].remap(image.pixels)
    sides = math.degrees(left), math.degrees(right)
    edges = (*sides, math.degrees(bottom), math.degrees(top))
    axes.imshow(cv2.cvtColor(pixels, cv2.COLOR_BGR2RGB), extent=edges, aspect="equal")
    step = 30 if left - right > math.pi else 10
    axes.set_xticks(np.arange(math.floor(sides[0] / step), sides[1] / step - 1e-9, -1) * step)
    axes.set_xlabel("azimuth (degrees, left of forward is positive)")
    axes.grid(color="white", alpha=0.5, linewidth=0.6)
    axes.axvline(0.0, color=PALETTE[1], linewidth=1.0)
    if camera.elevations_known:
        axes.set_ylabel("elevation (degrees)")
        axes.axhline(0.0, color=PALETTE[1], linewidth=1.0)
    else:
        axes.set_yticks([])

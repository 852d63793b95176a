"""Draws what a camera sees, unwarped, with azimuths: whether a camera.yaml is right is best seen."""

import math
from typing import TYPE_CHECKING, Annotated

import cv2
import numpy as np

from omninav.pipeline import BadInput, Bounds, Context, Figure, Outputs, Stage
from omninav.pipeline.files import user_path, write_whole
from omninav.pipeline.report.plot_style import PALETTE, plot
from omninav.stages.camera.donut import Donut
from omninav.stages.camera.model import Camera
from omninav.stages.recordings.opening import open_recording
from omninav.stages.recordings.recording import Topics
from omninav.stages.values.encoded_image import decode_image
from omninav.stages.values.image import Image

from .donut import DonutUnwrapState, with_ring
from .table import PanoramaTable

if TYPE_CHECKING:
    from matplotlib.axes import Axes

COLUMNS = 1440
"""Of the panorama that is drawn."""


class LookThroughCamera(Stage):
    """Writes the panorama of one image of a log as a PNG, with azimuths and, where they are known, elevations.

    Upright things stand upright in it, the horizon is level, and what is ahead of the robot is at 0 degrees, or the
    camera is not what it is said to be. Raises BadInput where the log cannot be read, or its camera does not see the
    full circle.
    """

    log: str | None = None
    """The log (see `open_recording`)."""
    camera: str | None = None
    """A camera.yaml, or a projection, in place of the log's own."""
    topics: Topics = Topics()
    """Which topics of the log are read."""
    frame: Annotated[int, Bounds(ge=0)] = 0
    """Which of its images; the next that can be decoded."""
    out: str = "look.png"
    """The file to write."""

    class Out(Outputs):
        """`figure`: what it writes as a file."""

        figure: Figure

    def step(self, ctx: Context) -> Out:
        """Unwarp one image and draw it."""
        path = user_path(self.out)
        if self.log is None or path.suffix != ".png":
            raise BadInput("look: name a log, and a .png to write: log=PATH out=look.png")
        recording = open_recording(self.log, self.topics, self.camera)
        frames = range(self.frame, len(recording.stamps))
        frame, pixels = next(((n, found) for n in frames if (found := recording.image(n)) is not None), (0, None))
        if pixels is None:
            raise BadInput(f"{self.log}: no image from number {self.frame} on; it has {len(recording.stamps)}")
        image, camera = Image(pixels), recording.camera
        if isinstance(camera, Donut):
            complete = with_ring(camera, image, DonutUnwrapState(), ctx)
            if complete is None:
                raise BadInput(
                    f"{self.log}: no ring of a mirror is found in image {frame}; type frame=NUMBER, or give "
                    "centre and mask in a camera.yaml"
                )
            camera = complete
        with plot(12.0, 4.2) as drawn:
            axes = drawn.canvas.subplots()
            draw_panorama(axes, image, camera)
            axes.set_title(f"image {frame} of {self.log}, {camera.projection} camera")
        write_whole(path, drawn.content)
        for sentence in recording.assumed:
            print(f"assumed: {sentence}")
        print(f"{path}: image {frame}, {camera.projection} camera; forward is at 0 degrees")
        return self.Out(
            figure=Figure(
                name="look",
                title="What the camera sees",
                caption=f"Image {frame} of {self.log} by a {camera.projection} camera, unwarped; forward is at 0. "
                "Where upright things lean or the horizon is bent, the camera is not what it is said to be.",
                content=cv2.imencode(".jpg", decode_image(drawn.content))[1].tobytes(),
                media_type="image/jpeg",
            )
        )


def draw_panorama(axes: "Axes", image: Image, camera: Camera) -> None:
    """Draw the panorama of an image over azimuth and elevation (degrees), square where elevations are known."""
    seen = camera.elevations
    top, bottom = (math.pi / 6, -math.pi / 6) if seen is None else seen  # without, unwarping says what is wrong
    rows = max(8, round(COLUMNS * (top - bottom) / (2.0 * math.pi)))
    panorama = PanoramaTable(COLUMNS, rows).panorama(image, camera)
    edges = (180.0, -180.0, math.degrees(bottom), math.degrees(top))
    axes.imshow(cv2.cvtColor(panorama.pixels, cv2.COLOR_BGR2RGB), extent=edges, aspect="equal")
    axes.set_xticks(np.arange(180, -181, -30))
    axes.set_xlabel("azimuth (degrees, left of forward is positive)")
    axes.grid(color="white", alpha=0.5, linewidth=0.6)
    axes.axvline(0.0, color=PALETTE[1], linewidth=1.0)
    if camera.elevations_known:
        axes.set_ylabel("elevation (degrees)")
        axes.axhline(0.0, color=PALETTE[1], linewidth=1.0)
    else:
        axes.set_yticks([])

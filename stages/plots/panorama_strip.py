"""Plots a few panoramas of a drive, one above the other."""

import math
from collections.abc import Sequence
from typing import Annotated

import numpy as np

from omninav.pipeline import Bounds, Context, Figure, Outputs, Stage
from omninav.pipeline.report.plot_style import plot
from omninav.stages.values.drive import Drive
from omninav.stages.values.image import Pixels
from omninav.stages.values.thumbnails import decoded

from .panorama_snapshot import EncodedPanorama
from .snapshot_times import spread_out


class PanoramaStrip(Stage):
    """Plots panoramas or windows of a few frames of the last log, azimuth in degrees along the lower edge."""

    frames: Annotated[int, Bounds(ge=1, le=8)] = 4
    """Number of rows."""

    class Out(Outputs):
        """`figure`: a row per frame."""

        figure: Figure | None = None

    def step(self, ctx: Context, drive: Drive, snapshots: Sequence[EncodedPanorama | None]) -> Out:
        """The whole run at once."""
        last = drive.last_log
        kept = [
            (frame, shot)
            for frame, row in zip(last.frames.tolist(), last.row.tolist(), strict=True)
            if (shot := snapshots[row]) is not None
        ]
        if not kept:
            return self.Out()
        chosen = [kept[i] for i in spread_out(len(kept), self.frames)]
        images = [(frame, decoded(shot.jpeg)) for frame, shot in chosen]
        headings = chosen[0][1].headings
        shown = (
            "Windows cut from the camera's images, from left to right, each with its heading below it."
            if len(headings) > 1
            else "The camera's images."
            if headings
            else "Panoramas: forward (0°) in the middle, left of the robot (+90°) on the left, both "
            "edges straight behind."
        )
        return self.Out(
            figure=Figure(
                name="panorama_strip",
                title="Images along the drive",
                caption=shown,
                content=_draw(images, headings),
                media_type="image/jpeg",
                order=5,
            )
        )


def _draw(images: Sequence[tuple[int, Pixels]], headings: Sequence[float]) -> bytes:
    rows, columns = images[0][1].shape[:2]
    height = float(np.clip(7.2 * rows / columns, 0.5, 2.2))
    ticks: list[float] = [180, 90, 0, -90, -180]
    labels = [f"{tick:g}" for tick in ticks]
    if headings:
        ticks = [180.0 - 360.0 * (n + 0.5) / len(headings) for n in range(len(headings))]
        labels = [f"{math.degrees(heading):.0f}" for heading in headings]
    if len(headings) == 1:
        return _side_by_side(images)
    with plot(8.0, len(images) * (height + 0.12) + 0.45, media_type="image/jpeg") as drawn:
        for number, (frame, pixels) in enumerate(images):
            axes = drawn.canvas.add_subplot(len(images), 1, number + 1)
            axes.imshow(pixels[:, :, ::-1], extent=(180, -180, 0, 1), aspect="auto", interpolation="antialiased")
            axes.set_yticks([])
            axes.set_ylabel(f"frame\n{frame}", rotation=0, ha="right", va="center", fontsize=8)
            axes.grid(visible=False)
            axes.set_xticks(ticks, labels)
            axes.tick_params(labelbottom=number == len(images) - 1)
            if number == len(images) - 1:
                axes.set_xlabel("azimuth (°), counter-clockwise from forward")
    return drawn.content


def _side_by_side(images: Sequence[tuple[int, Pixels]]) -> bytes:
    """Images of a perspective camera, which all look the same way."""
    rows, columns = images[0][1].shape[:2]
    with plot(8.0, 8.0 / len(images) * rows / columns + 0.3, media_type="image/jpeg") as drawn:
        for number, (frame, pixels) in enumerate(images):
            axes = drawn.canvas.add_subplot(1, len(images), number + 1)
            axes.imshow(pixels[:, :, ::-1], interpolation="antialiased")
            axes.set_title(f"frame {frame}", fontsize=8)
            axes.set_axis_off()
    return drawn.content

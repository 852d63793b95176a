"""What the robot saw: a few panoramas one above the other."""

import math
from collections.abc import Sequence
from typing import Annotated

import numpy as np

from omninav.pipeline import Bounds, Context, Outputs, Stage
from omninav.pipeline.graph.results import Figure
from omninav.stages.values.drive import Drive
from omninav.stages.values.image import Pixels
from omninav.stages.values.thumbnails import decoded

from .panorama_snapshot import EncodedPanorama
from .snapshot_times import spread_out
from .style import picture


class PanoramaStrip(Stage):
    """Panoramas or windows of a few frames of the last log, azimuth in degrees along the lower edge."""

    frames: Annotated[int, Bounds(ge=1, le=8)] = 4

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
        pictures = [(frame, decoded(shot.jpeg)) for frame, shot in chosen]
        headings = chosen[0][1].headings
        shown = (
            "Windows cut from its pictures, from the left to the right: where each looks stands below it."
            if len(headings) > 1
            else "The camera's pictures."
            if headings
            else "Its pictures as panoramas: forward (0°) in the middle, left of the robot (+90°) on the left, both "
            "edges straight behind."
        )
        return self.Out(
            figure=Figure(
                name="panorama_strip",
                title="What the robot saw",
                caption=shown,
                content=_draw(pictures, headings),
                media_type="image/jpeg",
                order=5,
            )
        )


def _draw(pictures: Sequence[tuple[int, Pixels]], headings: Sequence[float]) -> bytes:
    rows, columns = pictures[0][1].shape[:2]
    height = float(np.clip(7.2 * rows / columns, 0.5, 2.2))
    ticks: list[float] = [180, 90, 0, -90, -180]
    labels = [f"{tick:g}" for tick in ticks]
    if headings:
        ticks = [180.0 - 360.0 * (n + 0.5) / len(headings) for n in range(len(headings))]
        labels = [f"{math.degrees(heading):.0f}" for heading in headings]
    if len(headings) == 1:
        return _side_by_side(pictures)
    with picture(8.0, len(pictures) * (height + 0.12) + 0.45, media_type="image/jpeg") as drawn:
        for number, (frame, pixels) in enumerate(pictures):
            axes = drawn.canvas.add_subplot(len(pictures), 1, number + 1)
            axes.imshow(pixels[:, :, ::-1], extent=(180, -180, 0, 1), aspect="auto", interpolation="antialiased")
            axes.set_yticks([])
            axes.set_ylabel(f"frame\n{frame}", rotation=0, ha="right", va="center", fontsize=8)
            axes.grid(visible=False)
            axes.set_xticks(ticks, labels)
            axes.tick_params(labelbottom=number == len(pictures) - 1)
            if number == len(pictures) - 1:
                axes.set_xlabel("azimuth (°), counter-clockwise from forward")
    return drawn.content


def _side_by_side(pictures: Sequence[tuple[int, Pixels]]) -> bytes:
    """Pictures of an ordinary camera: as high as they are wide, more or less, and all look the same way."""
    rows, columns = pictures[0][1].shape[:2]
    with picture(8.0, 8.0 / len(pictures) * rows / columns + 0.3, media_type="image/jpeg") as drawn:
        for number, (frame, pixels) in enumerate(pictures):
            axes = drawn.canvas.add_subplot(1, len(pictures), number + 1)
            axes.imshow(pixels[:, :, ::-1], interpolation="antialiased")
            axes.set_title(f"frame {frame}", fontsize=8)
            axes.set_axis_off()
    return drawn.content

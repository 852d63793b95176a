"""Writes an image of the robot's camera as a file: a goal to drive to, or something to look at."""

from collections.abc import Sequence
from typing import Annotated

import cv2

from omninav.pipeline import Bounds, Context, Outputs, Stage, Tick, write_whole
from omninav.stages.values.image import Image


class ImageAt(Stage):
    """Picks one image of each log."""

    frame: Annotated[int, Bounds(ge=0)] = 0
    """Number of the frame."""

    class Out(Outputs):
        """`image`: absent at all other frames."""

        image: Image | None = None

    def step(self, ctx: Context, tick: Tick, image: Image) -> Out:
        return self.Out(image=image if tick.frame == self.frame else None)


class ImageFile(Stage):
    """Writes the first image as `image.png` into the run's folder, without loss."""

    def step(self, ctx: Context, images: Sequence[Image]) -> None:
        if images and ctx.folder is not None:
            _, encoded = cv2.imencode(".png", images[0].pixels)
            write_whole(ctx.folder / "image.png", encoded.tobytes())

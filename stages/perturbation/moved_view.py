"""A view shifted, turned in its plane, enlarged, sheared, or seen in part."""

import math
from typing import Annotated

import cv2
import numpy as np

from omninav.pipeline import Bounds, Context, Outputs, Stage
from omninav.stages.geometry.arrays import Bools
from omninav.stages.values.image import Pixels, Windows


def moved_view(
    pixels: Pixels, seen: Bools, shift: float, turn: float, scale: float, shear: float, part: float
) -> tuple[Pixels, Bools]:
    """An image (rows, columns, 3) and its seen pixels (rows, columns) after a motion about its middle.

    `shift`: to the right, as a share of the columns; `turn` (rad) counter-clockwise; `scale`: how much larger; `shear`:
    columns to the right for each row up; `part`: the share of the columns, from the left, that is still seen. What
    comes from outside the image is black and unseen.
    """
    rows, columns = pixels.shape[:2]
    motion = cv2.getRotationMatrix2D(((columns - 1) / 2, (rows - 1) / 2), math.degrees(turn), scale)
    motion[0] -= shear * (motion[1] - (0.0, 0.0, (rows - 1) / 2))
    motion[0, 2] += shift * columns
    moved = cv2.warpAffine(pixels, motion, (columns, rows), flags=cv2.INTER_LINEAR)
    still = cv2.warpAffine(seen.astype(np.uint8), motion, (columns, rows), flags=cv2.INTER_NEAREST) > 0
    still[:, round(part * columns) :] = False
    moved[~still] = 0
    return np.asarray(moved, np.uint8), np.asarray(still, np.bool_)


class MovedView(Stage):
    """Shows windows shifted, rotated, enlarged, sheared or cut, to which retrieval should be invariant.

    Wolf, Burgard & Burkhardt 2005, section IV: features are invariant to translation, rotation and, with kernels of
    several sizes, to scale up to two, and robust against distortion; equation 5 finds a view of a part of a scene in an
    image of more of it. What is not seen counts in no histogram.
    """

    shift: Annotated[float, Bounds(gt=-1, lt=1)] = 0.0
    """Shift to the right, as a share of the window's width."""
    turn_deg: Annotated[float, Bounds(ge=-180, le=180)] = 0.0
    """Counter-clockwise, about the window's middle."""
    scale: Annotated[float, Bounds(gt=0, le=10)] = 1.0
    """Factor by which things look larger."""
    shear: Annotated[float, Bounds(ge=-2, le=2)] = 0.0
    """A distortion: columns to the right for each row above the window's middle."""
    part: Annotated[float, Bounds(gt=0, le=1)] = 1.0
    """Share of the window's columns, from the left, that is seen."""

    class Out(Outputs):
        panorama: Windows

    def step(self, ctx: Context, panorama: Windows) -> Out:
        pixels = panorama.pixels
        seen = np.ones(pixels.shape[:3], np.bool_) if panorama.seen is None else panorama.seen
        how = self.shift, math.radians(self.turn_deg), self.scale, self.shear, self.part
        moved = [moved_view(window, known, *how) for window, known in zip(pixels, seen, strict=True)]
        shown, still = (np.stack(each) for each in zip(*moved, strict=True))
        return self.Out(panorama=Windows(shown, panorama.headings, panorama.field, still))

"""Keeps a few panoramas as small JPEGs, because images themselves are too large to be kept."""

import math
from typing import Annotated

import numpy as np

from omninav.pipeline import Context, Outputs, Shape, Stage, Tick, Value
from omninav.stages.camera.equirectangular import panorama_camera
from omninav.stages.camera.model import seen_at
from omninav.stages.camera.thumbnail import Thumbnail, thumbnail
from omninav.stages.geometry.arrays import Bools, Floats
from omninav.stages.values.image import Panorama, Windows
from omninav.stages.values.landmarks import LandmarkFix

from .snapshot_times import is_snapshot_frame

COLUMNS, QUALITY = 480, 80
"""Largest width (px) and JPEG quality of a kept image; some 15 kB."""


class EncodedPanorama(Value):
    """A panorama as JPEG bytes, columns as in `Panorama`; or windows side by side, the left one on the left.

    `headings`: where windows look, from the left to the right (radians, counter-clockwise from forward); empty: it is
    a panorama. `points` (N, 2): columns and rows in the JPEG of the features that were matched to landmarks, NaN where
    it does not show them, and `agree` (N,): which of them agree with the pose that they give; None: not looked for.
    """

    jpeg: bytes
    headings: tuple[float, ...] = ()
    points: Annotated[Floats | None, Shape("N", 2, finite=False)] = None
    agree: Annotated[Bools | None, Shape("N")] = None


class PanoramaSnapshot(Stage):
    """Encodes the panorama or the windows at even steps, some 60 to 120 of a drive; JPEG, at most 480 columns."""

    class Out(Outputs):
        """`snapshot`: absent at all other frames."""

        snapshot: EncodedPanorama | None = None

    def step(self, ctx: Context, tick: Tick, panorama: Panorama | Windows, fix: LandmarkFix | None = None) -> Out:
        """One frame; `fix`: by which of the features in it the pose was found."""
        if not is_snapshot_frame(tick.frame):
            return self.Out()
        small, headings = small_image(panorama, COLUMNS)
        jpeg = small.jpeg(QUALITY)
        if fix is None or fix.bearings is None or fix.agree is None or isinstance(panorama, Windows):
            return self.Out(snapshot=EncodedPanorama(jpeg, headings))
        points = small.points(seen_at(panorama_camera(panorama), fix.bearings.astype(np.float64)))
        return self.Out(snapshot=EncodedPanorama(jpeg, headings, points, fix.agree == 0))


def small_image(panorama: Panorama | Windows, columns: int) -> tuple[Thumbnail, tuple[float, ...]]:
    """A panorama, or windows side by side, in at most this many columns; and where the windows look."""
    if isinstance(panorama, Panorama):
        return thumbnail(panorama.pixels, None, columns), ()
    # From just right of straight behind around to straight behind, as a panorama is cut open.
    order = np.argsort(np.mod(math.pi - panorama.headings, 2 * math.pi), kind="stable")
    side_by_side = np.concatenate(panorama.pixels[order], axis=1)
    return thumbnail(side_by_side, None, columns), tuple(panorama.headings[order].tolist())

"""SIFT for a robot on a floor: patches are turned by where they are, not by what they show."""

from collections.abc import Sequence
from typing import Annotated, Any, Literal, cast

import cv2
import numpy as np

from omninav.pipeline import Bounds, Context, Outputs, Stage
from omninav.stages.camera.model import Camera
from omninav.stages.geometry.arrays import Bools, Floats
from omninav.stages.values.image import Image, Panorama, Pixels
from omninav.stages.values.local_features import LocalFeatures
from omninav.stages.values.own_body import OwnBody

from .colour_moments import disc_colours
from .prepared_image import PreparedImage, prepared_image

SEAM = 48
"""Columns that are repeated beyond both edges of a full circle, so that what is across the seam is found too."""
COLOUR_RADIUS = 3.0
"""Radius of the disc whose colours are taken, in diameters of the feature: about what the descriptor sees."""
EDGE_RATIO = 10.0
"""Largest ratio of principal curvatures of a feature, above which it is on an edge: OpenCV's default."""


class RotationReducedSift(Stage):
    """SIFT keypoints with a known orientation, as a robot on a floor stays upright, and the colours of each patch.

    Goedemé et al. 2007, section 3.2 (after Ledwich & Williams): OpenCV's detector and descriptor, turned outwards along
    the radius in a mirror image, inwards in that of a lens that looks up, up the column in a panorama or strip, else
    along the vertical as the camera shows it.
    Features closer to a mirror's edges than their own diameter are left out. Colours (equation 1, erratum 25 in
    docs/papers.md) are those of a disc around each feature. Raises BadInput for an image without a camera.
    """

    orientation: Literal["reduced", "own"] = "reduced"
    """`own`: Lowe's, by the strongest gradient."""
    max_features: Annotated[int, Bounds(ge=1)] = 300
    """The strongest are kept."""
    max_pixels: Annotated[int, Bounds(ge=1024)] = 76800
    """Larger images are made smaller; 320 x 240 is the paper's size."""
    contrast: Annotated[float, Bounds(ge=0)] = 0.04
    """OpenCV's threshold; at 0.02 features of floors and walls that repeat come in, and maps get wrong loops."""

    blur_px: Annotated[float, Bounds(gt=0.5)] = 1.6
    """Blur of the first octave (pixels): Lowe's. With less, finer points of a small image are found too."""

    class Out(Outputs):
        """Features that were found, the strongest first; there may be none."""

        features: LocalFeatures

    def setup(self, ctx: Context) -> None:
        """Make the detector; without the precise form it finds fine points a quarter of a pixel off."""
        self._camera: Camera | None = None
        self._mirrored = False
        self._body: OwnBody | None = None
        # Features that turn by themselves are found and described in one pass: some more, since edges take away; and
        # all, where a body takes away any number.
        self._sift = self._detector(2 * self.max_features if self.orientation == "own" else 0)
        self._unlimited = self._detector(0)

    def step(
        self, ctx: Context, image: Image | Panorama, camera: Camera | None = None, body: OwnBody | None = None
    ) -> Out:
        """Find the features of an image but for those of the robot's own `body`."""
        read = prepared_image(image, camera, self.max_pixels)
        pixels, seen, seam, sift = read.pixels, read.seen, 0, self._sift
        hidden = body is not None and body.found_in(read.camera.width, read.camera.height_px)
        if body is not None and hidden:
            seen, sift = seen & self._shows(read, body), self._unlimited
        if read.circle:
            seam = min(SEAM, pixels.shape[1])
            pixels = np.concatenate([pixels[:, -seam:], pixels, pixels[:, :seam]], axis=1)
            seen = np.concatenate([seen[:, -seam:], seen, seen[:, :seam]], axis=1)
        grey = cast(Pixels, cv2.cvtColor(pixels, cv2.COLOR_BGR2GRAY))
        mask = None if read.camera.upright and not hidden else seen.astype(np.uint8)
        found = self._strongest(self._detected(sift, grey, mask), read, seam)
        if not found:
            return self.Out(features=none_found())
        descriptors = self._described(grey, found)
        points = np.array([point.pt for point in found], np.float64)
        sizes = np.array([point.size for point in found], np.float32)
        colours = disc_colours(pixels, seen, points, COLOUR_RADIUS * sizes)
        points = read.original(points - (seam, 0))
        sizes *= np.float32(read.scale.mean())
        if camera is not self._camera:
            self._camera, self._mirrored = camera, read.camera.mirrored
        bearings, rows = read.bearings(points), descriptors.astype(np.uint8)
        features = LocalFeatures(bearings, points, rows, colours, sizes, mirrored=self._mirrored)
        shown = np.isfinite(features.bearings).all(axis=1)  # beyond the mirror's edge there is nothing to see
        return self.Out(features=features.chosen(np.flatnonzero(shown)))

    def _detector(self, number: int) -> cv2.SIFT:
        return cv2.SIFT.create(
            nfeatures=number,
            contrastThreshold=self.contrast,
            edgeThreshold=EDGE_RATIO,
            sigma=self.blur_px,
            enable_precise_upscale=True,
        )

    def _shows(self, read: PreparedImage, body: OwnBody) -> Bools:
        """Tells which pixels (rows, columns) of the image are not of the robot's own body."""
        if body is not self._body:
            rows, columns = read.seen.shape
            grid = np.stack(np.meshgrid(np.arange(float(columns)), np.arange(float(rows))), axis=-1)
            self._body, self._world = body, ~body.hides(read.original(grid))
        return self._world

    def _detected(self, sift: cv2.SIFT, grey: Pixels, mask: Pixels | None) -> list[cv2.KeyPoint]:
        if self.orientation == "reduced":
            return list(sift.detect(grey, mask))
        return self._with_rows(*sift.detectAndCompute(grey, mask))

    def _with_rows(self, found: Sequence[cv2.KeyPoint], rows: Any) -> list[cv2.KeyPoint]:
        self._rows = rows
        for row, point in enumerate(found):
            point.class_id = row
        return list(found)

    def _described(self, grey: Pixels, found: list[cv2.KeyPoint]) -> Floats:
        if self.orientation == "own":
            return np.asarray(self._rows[[point.class_id for point in found]], np.float32)
        return cast(Floats, self._sift.compute(grey, found)[1])

    def _strongest(self, found: list[cv2.KeyPoint], read: PreparedImage, seam: int) -> list[cv2.KeyPoint]:
        if not found:
            return []
        rows = np.array([(p.response, p.pt[0], p.pt[1], p.size, p.angle) for p in found], np.float64)
        order = np.lexsort((rows[:, 4], rows[:, 3], rows[:, 2], rows[:, 1], -rows[:, 0]))
        if self.orientation == "reduced":  # a point with two orientations was found twice
            places = rows[order, 1:4]
            order = order[np.append(True, (places[1:] != places[:-1]).any(axis=1))]
        x, y, size = rows[order, 1], rows[order, 2], rows[order, 3]
        if read.ring is not None:
            radius = np.hypot(x - read.ring.centre_x, y - read.ring.centre_y)
            inside = (radius - read.ring.inner >= size) & (read.ring.outer - radius >= size)
        else:
            inside = (x - seam >= -0.5) & (x - seam < read.pixels.shape[1] - 0.5)
        kept = np.flatnonzero(inside)[: self.max_features]
        strongest = [found[order[row]] for row in kept]
        if self.orientation == "reduced":
            angles = read.upward(np.column_stack([x - seam, y])[kept])
            for angle, point in zip(angles, strongest, strict=True):
                point.angle = float(angle)
        return strongest


def none_found(length: int = 128) -> LocalFeatures:
    """No features, of descriptors of this length."""
    return LocalFeatures(
        np.empty((0, 3)),
        np.empty((0, 2)),
        np.empty((0, length), np.uint8),
        np.empty((0, 3), np.float32),
        np.empty(0, np.float32),
    )

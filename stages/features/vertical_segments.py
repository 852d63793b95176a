"""Invariant vertical segments: lines between two edges, described along their length."""

import math
from typing import Annotated, NamedTuple, cast

import cv2
import numpy as np

from omninav.pipeline import Bounds, Context, Outputs, Stage
from omninav.pipeline.engine.compiled import compiled
from omninav.stages.camera.model import Camera
from omninav.stages.camera.rays import unit_vectors
from omninav.stages.geometry.appearance.feature_matching import spreads
from omninav.stages.geometry.arrays import Array, Floats, Ints
from omninav.stages.values.image import Image, Panorama, Pixels
from omninav.stages.values.local_features import VerticalSegments

from .colour_moments import add_pixel, correlations
from .prepared_image import PreparedImage, prepared_image

SAMPLES = 8
"""Samples of a segment's intensity profile: the paper's 8-point cosine transform."""
COEFFICIENTS = 7
"""Coefficients of it that are kept: the first ones."""
BLUR_PX = 1.0
"""Standard deviation of the smoothing before edges are searched, pixels."""
MIN_GRADIENT = 0.25
"""Smallest gradient of an edge, per pixel, in standard deviations of the image's intensity."""
MIN_LENGTH_PX = 8.0
"""Shortest segment, pixels."""
AZIMUTH_SIGMA_DEG = 3.0
"""Difference in azimuth that counts as one in the distance of two segments, degrees."""
LINES = 360
"""Radii of a mirror image, or azimuths of two fisheyes, along which segments are searched."""
MARGIN = 0.2
"""Share of its length by which a segment is widened at both ends for its colours."""


def profile_basis() -> Floats:
    """Rows 0 to 6 of the orthonormal 8-point cosine transform: (7, 8)."""
    n = np.arange(SAMPLES)
    rows = np.arange(COEFFICIENTS)[:, None]
    basis = math.sqrt(2.0 / SAMPLES) * np.cos(np.pi * (n + 0.5) * rows / SAMPLES)
    basis[0] /= math.sqrt(2.0)
    return basis.astype(np.float32)


class ImageSegments(NamedTuple):
    """Segments on upright lines: `lines` (N,); `ends` (N, 2), rows of upper and lower end; `descriptors` (N, 10)."""

    lines: Ints
    ends: Array
    descriptors: Floats


def _edges(steps: Floats, min_step: float) -> tuple[Ints, Array]:
    # Columns and rows (E,) of the local maxima along columns, between rows by a parabola through three.
    before, here, after = (steps[k : len(steps) - 2 + k].astype(np.float64) for k in range(3))
    lines, rows = np.nonzero(((here >= min_step) & (here > before) & (here >= after)).T)
    before, here, after = (each[rows, lines] for each in (before, here, after))
    bend = before - 2.0 * here + after
    shift: Array = np.divide(0.5 * (before - after), bend, out=np.zeros(len(rows)), where=bend < 0.0)
    return lines.astype(np.int64), rows + 1 + shift


@compiled(nogil=True)
def _describe(
    pixels: Pixels, grey: Floats, lines: Ints, ends: Array, margin: float, basis: Floats, out: Floats
) -> None:
    height = grey.shape[0]
    sums, profile = np.empty(10), np.empty(SAMPLES, np.float32)
    for n in range(len(lines)):
        column, top, bottom = lines[n], ends[n, 0], ends[n, 1]
        length = bottom - top
        sums[:] = 0.0
        first = max(0, int(np.ceil(top - margin * length)))
        last = min(height - 1, int(np.floor(bottom + margin * length)))
        for row in range(first, last + 1):
            blue, green, red = pixels[row, column, 0], pixels[row, column, 1], pixels[row, column, 2]
            add_pixel(sums, float(blue), float(green), float(red))
        correlations(sums, out[n])
        for k in range(SAMPLES):
            at = top + (k + 0.5) * length / SAMPLES
            row = min(max(int(at), 0), height - 2)
            part = np.float32(at - row)
            profile[k] = (1 - part) * grey[row, column] + part * grey[row + 1, column]
        for c in range(COEFFICIENTS):
            total = np.float32(0.0)
            for k in range(SAMPLES):
                total += basis[c, k] * profile[k]
            out[n, 3 + c] = total


def segments_of(
    pixels: Pixels, circle: bool, blur: float, min_gradient: float, min_length: float, margin: float
) -> ImageSegments:
    """All segments of an image whose columns are upright lines, the upper end of each at the smaller row.

    An edge is a local maximum along a column of the intensity's gradient, of the image smoothed by `blur` pixels,
    above `min_gradient` standard deviations of its intensity per pixel: neither scale nor offset of the light changes
    it. Every two neighbouring edges at least `min_length` pixels apart make a segment. Descriptors: colour correlations
    over the segment widened by `MARGIN` of its length on both sides; the first seven cosine coefficients of the
    profile's 8 samples (grey levels). `circle`: the columns go around.
    """
    seam = min(max(2, math.ceil(3.0 * blur)), pixels.shape[1]) if circle else 0
    padded = np.concatenate([pixels[:, pixels.shape[1] - seam :], pixels, pixels[:, :seam]], axis=1) if seam else pixels
    smooth = cast(Pixels, cv2.GaussianBlur(padded, (0, 0), blur))
    smooth = np.ascontiguousarray(smooth[:, seam : smooth.shape[1] - seam] if seam else smooth)
    grey = cv2.cvtColor(smooth, cv2.COLOR_BGR2GRAY).astype(np.float32)
    steps = np.zeros_like(grey)
    steps[1:-1] = np.abs(grey[2:] - grey[:-2]) / 2.0
    lines, rows = _edges(steps, max(min_gradient * float(grey.std()), 1e-3))
    kept = np.flatnonzero((lines[1:] == lines[:-1]) & (rows[1:] - rows[:-1] >= min_length))
    ends = np.stack([rows[kept], rows[kept + 1]], axis=-1)
    descriptors = np.empty((len(kept), 3 + COEFFICIENTS), np.float32)
    _describe(smooth, grey, lines[kept], ends, margin, profile_basis(), descriptors)
    return ImageSegments(lines[kept], ends, descriptors)


@compiled(nogil=True)
def _count_neighbours(
    starts: Ints, ends: Array, scaled: Floats, reach: int, scale: float, distance: float, circle: bool, crowd: Floats
) -> None:
    columns = len(starts) - 1
    for column in range(columns):
        for step in range(0, reach + 1):
            other = column + step
            if other >= columns:
                if not circle or step >= columns:
                    break
                other -= columns
            across = (step * scale) ** 2
            for i in range(starts[column], starts[column + 1]):
                for j in range(i if step == 0 else starts[other], starts[other + 1]):
                    if ends[i, 0] >= ends[j, 1] or ends[j, 0] >= ends[i, 1]:
                        continue
                    d = across
                    for k in range(scaled.shape[1]):
                        d += (scaled[i, k] - scaled[j, k]) ** 2
                    if d <= distance * distance:
                        share = np.float32(1.0 - d / (distance * distance))
                        crowd[i] += share
                        if i != j:
                            crowd[j] += share


@compiled(nogil=True)
def _prototypes(
    order: Ints,
    lines: Ints,
    starts: Ints,
    ends: Array,
    scaled: Floats,
    reach: int,
    scale: float,
    distance: float,
    circle: bool,
    weights: Floats,
) -> None:
    columns = len(starts) - 1
    taken = np.zeros(len(order), np.bool_)
    for i in order:
        if taken[i]:
            continue
        for step in range(-reach, reach + 1):
            other = lines[i] + step
            if other < 0 or other >= columns:
                if not circle or 2 * reach >= columns:
                    continue
                other = other % columns
            across = (step * scale) ** 2
            for j in range(starts[other], starts[other + 1]):
                if taken[j] or ends[i, 0] >= ends[j, 1] or ends[j, 0] >= ends[i, 1]:
                    continue
                d = across
                for k in range(scaled.shape[1]):
                    d += (scaled[i, k] - scaled[j, k]) ** 2
                if d <= distance * distance:
                    taken[j] = True
                    weights[i] += 1.0


def prototypes(
    found: ImageSegments, columns: int, azimuth_sigma: float, distance: float, circle: bool
) -> tuple[Ints, Floats]:
    """One segment for each group of similar neighbours: rows, heaviest first, and how many each represents.

    Neighbours overlap in height and are at most `distance` apart by the Mahalanobis distance of their descriptors,
    extended by the distance of their columns, in units of `azimuth_sigma` columns (section 3.3). Those with most
    neighbours are taken first, and take all their neighbours with them: the middle of a group, however the robot is
    turned.
    """
    weights = np.zeros(len(found.lines), np.float32)
    if not len(weights):
        return np.empty(0, np.int64), weights
    scaled = found.descriptors / spreads(found.descriptors)
    starts = np.searchsorted(found.lines, np.arange(columns + 1))
    reach, scale = int(distance * azimuth_sigma), 1.0 / azimuth_sigma
    crowd = np.zeros(len(weights), np.float32)
    _count_neighbours(starts, found.ends, scaled, reach, scale, distance, circle, crowd)
    order = np.argsort(-crowd, kind="stable")
    _prototypes(order, found.lines, starts, found.ends, scaled, reach, scale, distance, circle, weights)
    kept = order[weights[order] > 0.0]
    kept = kept[np.argsort(-weights[kept], kind="stable")]
    return kept, weights[kept]


class FindVerticalSegments(Stage):
    """Vertical lines between two edges, described by their colours and their profile.

    Goedemé et al. 2007, section 3.3: along every radius of a mirror image, or every column of a panorama, to which two
    fisheyes are unwarped, each two neighbouring gradient maxima bound a segment; its descriptor holds three colour
    correlations over the widened segment and "the seven first coefficients" of the 8-point cosine transform of its
    profile, the brightness among them: they are called invariant to the light, and are not (erratum 25a in
    docs/papers.md). Similar neighbours become one (`prototypes`). Raises BadInput for an image without a camera.
    """

    max_segments: Annotated[int, Bounds(ge=1)] = 200
    """The heaviest prototypes are kept."""
    max_pixels: Annotated[int, Bounds(ge=1024)] = 76800
    """Larger images are made smaller; 320 x 240 is the paper's size."""
    cluster_distance: Annotated[float, Bounds(gt=0)] = 2.0
    """Mahalanobis distance within which neighbours become one."""

    class Out(Outputs):
        """Segments that were found, the heaviest first; there may be none."""

        vertical_segments: VerticalSegments

    def step(self, ctx: Context, image: Image | Panorama, camera: Camera | None = None) -> Out:
        read = prepared_image(image, camera, self.max_pixels)
        pixels, circle = self._upright(read)
        settings = BLUR_PX, MIN_GRADIENT, MIN_LENGTH_PX, MARGIN
        found = segments_of(pixels, circle, *settings)
        width = pixels.shape[1]
        kept, weights = prototypes(found, width, AZIMUTH_SIGMA_DEG * width / 360.0, self.cluster_distance, circle)
        kept, weights = kept[: self.max_segments], weights[: self.max_segments]
        lines = np.broadcast_to(found.lines[kept, None], (len(kept), 2)).astype(np.float64)
        points = read.original(self._back(np.stack([lines, found.ends[kept]], axis=-1), read))
        bearings = read.bearings(points)
        elevations = np.arcsin(np.clip(bearings[..., 2], -1.0, 1.0))
        middle = bearings.sum(axis=1)
        azimuths = np.arctan2(middle[:, 1], middle[:, 0])
        return self.Out(
            vertical_segments=VerticalSegments(azimuths, elevations, found.descriptors[kept], weights, points)
        )

    def _upright(self, read: PreparedImage) -> tuple[Pixels, bool]:
        """The image with its upright lines as columns, the upper end of a radius at the top."""
        if read.camera.upright:
            return read.pixels, read.circle
        length = LINES // 2 if read.ring is None else int(read.ring.outer - read.ring.inner) + 1
        lines, rows = np.meshgrid(np.arange(LINES), np.arange(length))
        points = self._back(np.stack([lines, rows], axis=-1).astype(np.float64), read).astype(np.float32)
        upright = cv2.remap(read.pixels, points[..., 0], points[..., 1], cv2.INTER_LINEAR)
        return cast(Pixels, upright), True

    def _back(self, points: Array, read: PreparedImage) -> Array:
        """Points (..., 2) of the upright image as points of the image that was read."""
        if read.camera.upright:
            return points
        angle = 2.0 * math.pi * points[..., 0] / LINES
        if read.ring is None:  # half a circle from the zenith down
            rays = unit_vectors(-angle, math.pi / 2 - 2.0 * math.pi * (points[..., 1] + 0.5) / LINES)
            return (read.camera.project(rays)[0] + 0.5) / read.scale - 0.5
        radius = read.ring.inner + points[..., 1] if read.camera.looks_up else read.ring.outer - points[..., 1]
        around = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
        middle = np.array([read.ring.centre_x, read.ring.centre_y])
        back: Array = middle + radius[..., None] * around
        return back

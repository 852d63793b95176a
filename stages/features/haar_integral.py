"""Histograms of Haar integrals: products of neighbouring pixels averaged over rotations."""

from typing import Annotated, Literal, NamedTuple

import cv2
import numpy as np

from omninav.pipeline import BadInput, Bounds, Context, Metrics, Outputs, Stage
from omninav.pipeline.engine.compiled import compiled
from omninav.stages.geometry.appearance.haar_integrals import Kernel, padded
from omninav.stages.geometry.arrays import Array, Bools, Floats
from omninav.stages.values.features import SegmentHistograms
from omninav.stages.values.image import Panorama, Pixels, Windows

from .grey_world import UnderGreyWorld
from .segment_edges import segment_edges

Radius = Annotated[float, Bounds(ge=0)]
Scale = Annotated[float, Bounds(gt=0)]
Borders = Literal["crop", "wrap"]


class Binning(NamedTuple):
    """Counts values in [0, 1] of three channels.

    `bins` per channel; `joint`: one histogram over all channels (bins^3, the first slowest), else one for each, behind
    one another and with equal shares of the mass. A value counts for the two bins whose middles it is between, by its
    distance from them.
    """

    bins: int = 8
    joint: bool = True

    @property
    def length(self) -> int:
        """Number of bins of all channels."""
        return self.bins**3 if self.joint else 3 * self.bins

    def shares(self, values: Floats, usable: Bools) -> tuple[Array, float]:
        """Histogram of values (N, 3) as shares of all N, and the standard error of its bins if these N are a sample.

        Values that are not `usable` (N,) count nowhere. The error is the root of the sum of the bins' variances: the
        expected distance of the histogram from that of everything the sample was drawn from.
        """
        counts = np.zeros(self.length)
        squares = _count(values, usable, self.bins, self.joint, counts)
        shares = counts / len(values)
        variance = max(squares / len(values) - float(shares @ shares), 0.0)
        return shares, float(np.sqrt(variance / len(values)))


@compiled(nogil=True)
def _place(value: float, bins: int) -> tuple[int, float]:
    """The bin of a value, and the share of it that counts for the next one."""
    place = value * bins - 0.5
    low = min(max(int(np.floor(place)), 0), bins - 1)
    return low, min(max(place - low, 0.0), 1.0) if low + 1 < bins else 0.0


@compiled(nogil=True)
def _count(values: Floats, usable: Bools, bins: int, joint: bool, counts: Array) -> float:
    # Gives the sum over values of their squared shares: 1 each where all of a value goes to one bin.
    squares = 0.0
    for n in range(len(values)):
        if not usable[n]:
            continue
        if joint:
            i, x = _place(values[n, 0], bins)
            j, y = _place(values[n, 1], bins)
            k, z = _place(values[n, 2], bins)
            for corner in range(8):
                a, b, c = corner & 1, (corner >> 1) & 1, corner >> 2
                share = (x if a else 1.0 - x) * (y if b else 1.0 - y) * (z if c else 1.0 - z)
                if share > 0.0:
                    counts[((i + a) * bins + j + b) * bins + k + c] += share
                    squares += share * share
        else:
            for channel in range(3):
                low, part = _place(values[n, channel], bins)
                below, above = (1.0 - part) / 3.0, part / 3.0
                counts[channel * bins + low] += below
                squares += below * below
                if above > 0.0:
                    counts[channel * bins + low + 1] += above
                    squares += above * above
    return squares


def usable_pixels(shape: tuple[int, int], by: int, crop_rows: bool, crop_columns: bool, seen: Bools | None) -> Bools:
    """Pixels of an image (rows, columns) whose neighbours within `by` pixels are all in it and `seen`."""
    usable = np.ones(shape, np.bool_)
    if crop_rows:
        usable[:by] = usable[max(shape[0] - by, 0) :] = False
    if crop_columns:
        usable[:, :by] = usable[:, max(shape[1] - by, 0) :] = False
    if seen is not None:
        around = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * by + 1, 2 * by + 1))
        usable &= cv2.erode(seen.astype(np.uint8), around).astype(np.bool_)
    return usable


class HaarIntegral(UnderGreyWorld, Stage):
    """Describes a view by histograms of Haar integrals, invariant to rotation and shift.

    Wolf, Burgard & Burkhardt 2005, section IV. A kernel (r1, r2) is f = M(0, r1) M(r2, at 90 degrees); it is averaged
    over rotations around each pixel, per colour channel, with bilinear interpolation (equation 4, errata 40 and 42 in
    docs/papers.md), and the averages are counted. The histograms of several kernels follow one another with equal
    shares of the mass, repeated for each scale. A panorama is described in equal segments, windows one by one. Metric
    `standard_error`: the expected distance of a segment's histogram from that of full integration, in the last image.
    Raises BadInput where an image is smaller than a kernel.
    """

    kernels: tuple[tuple[Radius, Radius], ...] = ((3.0, 4.0),)
    """Radii r1 and r2 (pixels) of each kernel."""
    scales: tuple[Scale, ...] = (1.0,)
    """Factors by which the kernels are enlarged; [1.0, 1.41, 2.0] recognises views from up to half the distance."""
    angles: Annotated[int, Bounds(ge=1)] = 36
    """Rotations of a kernel."""
    root: bool = True
    """Take the square root of the product, whose values fill the bins more evenly."""
    histogram: Literal["joint", "separate"] = "joint"
    """One histogram over the colour channels, or one for each: the paper's, which "considers the different channels
    independently" (section IV)."""
    bins: Annotated[int, Bounds(ge=1, le=64)] | None = None
    """Bins per channel; null: 8 for windows, 5 for a panorama's segments (936 images then fit in the paper's 4 MB, with
    joint histograms too)."""
    segments: Annotated[int, Bounds(ge=1)] = 8
    """Equal parts of a panorama."""
    borders: Borders = "crop"
    """`crop` (erratum 41): pixels with neighbours outside the image are left out, so that histograms sum to less than
    1; panoramas continue around the circle. `wrap`: the paper's "modulo N", both ways, for all images."""
    integration: Literal["full", "monte_carlo"] = "full"
    """`monte_carlo`: at random pixels only."""
    samples: Annotated[int, Bounds(ge=1)] = 2000
    """Random pixels of each segment with `monte_carlo`."""

    class Out(Outputs):
        """The description of the view; `metrics`: the error of Monte Carlo integration."""

        features: SegmentHistograms
        metrics: Metrics | None = None

    def __post_init__(self) -> None:
        """Refuses settings without a kernel or a scale."""
        if not self.kernels:
            raise ValueError("kernels: at least one is needed; write kernels: [[3, 4]]")
        if not self.scales:
            raise ValueError("scales: at least one is needed; write scales: [1.0]")

    def step(self, ctx: Context, panorama: Panorama | Windows) -> Out:
        errors: list[float] = []
        if isinstance(panorama, Windows):
            seen = [None] * len(panorama.pixels) if panorama.seen is None else list(panorama.seen)
            values = [
                self._described(ctx, self.constant(pixels, circle=False), 1, self._binning(8), part, errors)[0]
                for pixels, part in zip(panorama.pixels, seen, strict=True)
            ]
            features = SegmentHistograms(np.stack(values), panorama.headings, len(self.scales))
        else:
            pixels = self.constant(panorama.pixels)
            described = self._described(ctx, pixels, self.segments, self._binning(5), None, errors, True)
            features = SegmentHistograms(described, scales=len(self.scales))
        if not errors:
            return self.Out(features=features)
        figures = {"samples": self.samples, "standard_error": float(np.mean(errors))}
        return self.Out(features=features, metrics=Metrics({"haar_integral": figures}))

    def _binning(self, bins: int) -> Binning:
        return Binning(bins if self.bins is None else self.bins, self.histogram == "joint")

    def _described(
        self,
        ctx: Context,
        pixels: Pixels,
        segments: int,
        binning: Binning,
        seen: Bools | None,
        errors: list[float],
        circle: bool = False,
    ) -> Floats:
        """Histograms of an image's segments: (segments, scales x kernels x bins)."""
        kernels = [
            Kernel((scale * one, scale * other), self.angles, self.root)
            for scale in self.scales
            for one, other in self.kernels
        ]
        wrap, (rows, columns) = self.borders == "wrap", pixels.shape[:2]
        edges = segment_edges(columns, segments)
        described, distances = np.empty((segments, len(kernels), binning.length)), np.zeros(segments)
        for k, kernel in enumerate(kernels):
            if kernel.margin >= min(rows, columns):
                raise BadInput(
                    f"features: an image of {columns} x {rows} pixels is too small for a kernel of {kernel.margin}; "
                    "write nodes.features.kernels=[[3,4]] and nodes.features.scales=[1.0], or unwarp to a larger one"
                )
            image = padded(pixels, kernel.margin + 1, wrap, wrap or circle)
            usable = usable_pixels((rows, columns), kernel.margin, not wrap, not (wrap or circle), seen)
            if self.integration == "full":
                means = kernel.means(image)
            for j in range(segments):
                first, end = int(edges[j]), int(edges[j + 1])
                if self.integration == "full":
                    part = means[:, first:end].reshape(-1, 3), usable[:, first:end].ravel()
                    described[j, k], _ = binning.shares(*part)
                else:
                    row = ctx.rng.integers(0, rows, self.samples)
                    column = ctx.rng.integers(first, end, self.samples)
                    part = kernel.means_at(image, row, column), usable[row, column]
                    described[j, k], error = binning.shares(*part)
                    distances[j] = np.hypot(distances[j], error)
        if self.integration == "monte_carlo":
            errors.extend(distances / len(self.kernels))
        return (described / len(self.kernels)).reshape(segments, -1).astype(np.float32)

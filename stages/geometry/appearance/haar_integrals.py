"""Haar integrals over rotations: what a product of two neighbours is on average as the kernel turns around a pixel.

Wolf, Burgard & Burkhardt 2005, section IV, equation 4 and algorithm 1, with +t instead of -t in equation 3: the value
at a pixel is that of its own neighbourhood (erratum 40 in docs/papers.md).
"""

import math
from typing import NamedTuple

import cv2
import numpy as np

from omninav.pipeline.engine.compiled import compiled
from omninav.stages.geometry.arrays import Bytes, Floats, Ints

Taps = tuple[Ints, Floats, Ints, Floats]
"""Offsets and weights (angles, 4), as `circle_taps` gives them, of both factors of a kernel."""


def circle_taps(radius: float, angles: int, turn: float, stride: int, channels: int) -> tuple[Ints, Floats]:
    """Positions of a factor of the kernel at `angles` equal steps around a circle of `radius` pixels.

    At each four pixels, as offsets from the one that the kernel turns around in an image with `stride` values in a row,
    and their bilinear weights: (angles, 4) each. The first is at `turn` radians; angles run from the direction of
    growing columns to that of growing rows.
    """
    angle = 2.0 * math.pi * np.arange(angles) / angles + turn
    # Rounded, so that a neighbour on the very pixel is not read from the one before with a weight of 1e-16.
    x, y = np.round(radius * np.cos(angle), 9), np.round(radius * np.sin(angle), 9)
    column, row = np.floor(x).astype(np.int64), np.floor(y).astype(np.int64)
    right, down = x - column, y - row
    at = row * stride + column * channels
    weights = np.stack([(1 - right) * (1 - down), right * (1 - down), (1 - right) * down, right * down], axis=1)
    return at[:, None] + np.array([0, channels, stride, stride + channels]), weights.astype(np.float32)


@compiled(nogil=True, error_model="numpy")
def _row_of_taps(flat: Floats, at: int, offsets: Ints, weights: Floats, out: Floats) -> None:
    length = len(out)
    s0, s1 = flat[at + offsets[0] : at + offsets[0] + length], flat[at + offsets[1] : at + offsets[1] + length]
    s2, s3 = flat[at + offsets[2] : at + offsets[2] + length], flat[at + offsets[3] : at + offsets[3] + length]
    w0, w1, w2, w3 = weights[0], weights[1], weights[2], weights[3]
    for x in range(length):
        out[x] = (w0 * s0[x] + w1 * s1[x]) + (w2 * s2[x] + w3 * s3[x])


@compiled(nogil=True, error_model="numpy")
def _means(flat: Floats, stride: int, start: int, taps: Taps, root: bool, out: Floats) -> None:
    # One row of all channels at a time, angle by angle: the inner loops are whole vector instructions.
    first, first_weights, second, second_weights = taps
    angles, (rows, length) = len(first), out.shape
    share = np.float32(1.0 / angles)
    # A neighbour at distance 0 is the pixel itself, whatever the angle: it is read once.
    still = (first == first[0]).all() and (first_weights == first_weights[0]).all()
    one, other, total = np.empty(length, np.float32), np.empty(length, np.float32), np.empty(length, np.float32)
    for row in range(rows):
        at = start + row * stride
        total[:] = np.float32(0)
        for p in range(angles):
            if p == 0 or not still:
                _row_of_taps(flat, at, first[p], first_weights[p], one)
            _row_of_taps(flat, at, second[p], second_weights[p], other)
            if root:
                for x in range(length):
                    total[x] += np.sqrt(one[x] * other[x])
            else:
                for x in range(length):
                    total[x] += one[x] * other[x]
        for x in range(length):
            out[row, x] = total[x] * share


@compiled(nogil=True, error_model="numpy")
def _means_at(flat: Floats, starts: Ints, taps: Taps, root: bool, out: Floats) -> None:
    first, first_weights, second, second_weights = taps
    angles, channels = len(first), out.shape[1]
    share = np.float32(1.0 / angles)
    one, other = np.empty((angles, channels), np.float32), np.empty((angles, channels), np.float32)
    for n in range(len(starts)):
        at = starts[n]
        for p in range(angles):
            f0, f1, f2, f3 = at + first[p, 0], at + first[p, 1], at + first[p, 2], at + first[p, 3]
            s0, s1, s2, s3 = at + second[p, 0], at + second[p, 1], at + second[p, 2], at + second[p, 3]
            v, w = first_weights[p], second_weights[p]
            for c in range(channels):
                one[p, c] = (v[0] * flat[f0 + c] + v[1] * flat[f1 + c]) + (v[2] * flat[f2 + c] + v[3] * flat[f3 + c])
                other[p, c] = (w[0] * flat[s0 + c] + w[1] * flat[s1 + c]) + (w[2] * flat[s2 + c] + w[3] * flat[s3 + c])
        for c in range(channels):
            total = np.float32(0)
            for p in range(angles):
                total += np.sqrt(one[p, c] * other[p, c]) if root else one[p, c] * other[p, c]
            out[n, c] = total * share


def padded(pixels: Bytes, by: int, wraps_rows: bool, wraps_columns: bool) -> Floats:
    """An image in [0, 1] with `by` more pixels on each side: from the other one where it wraps, else repeated."""
    scaled = pixels.astype(np.float32) * np.float32(1.0 / 255.0)
    rows, columns = (cv2.BORDER_WRAP if wraps else cv2.BORDER_REPLICATE for wraps in (wraps_rows, wraps_columns))
    higher = cv2.copyMakeBorder(scaled, by, by, 0, 0, rows)
    return cv2.copyMakeBorder(higher, 0, 0, by, by, columns).astype(np.float32, copy=False)


class Kernel(NamedTuple):
    """A product of two neighbours, f = M(0, r1) M(r2, at 90 degrees), and how it is integrated over its rotations.

    `radii`: (r1, r2) pixels. `angles`: how many rotations. `root`: the integrand is the square root of the product.
    """

    radii: tuple[float, float]
    angles: int = 36
    root: bool = False

    @property
    def margin(self) -> int:
        """Number of pixels around one that it reads."""
        return math.ceil(max(self.radii))

    def _taps(self, stride: int, channels: int) -> Taps:
        first = circle_taps(self.radii[0], self.angles, 0.0, stride, channels)
        return *first, *circle_taps(self.radii[1], self.angles, math.pi / 2, stride, channels)

    def means(self, padded: Floats) -> Floats:
        """The integral at each pixel of an image: (rows, columns, channels), of values in [0, 1] in [0, 1].

        `padded` (rows + 2 m, columns + 2 m, channels) is the image with m = `margin` + 1 more pixels on each side.
        """
        m, (rows, columns, channels) = self.margin + 1, padded.shape
        stride = columns * channels
        out = np.empty((rows - 2 * m, (columns - 2 * m) * channels), np.float32)
        _means(padded.ravel(), stride, m * stride + m * channels, self._taps(stride, channels), self.root, out)
        return out.reshape(rows - 2 * m, columns - 2 * m, channels)

    def means_at(self, padded: Floats, rows: Ints, columns: Ints) -> Floats:
        """The integral at some pixels (N,), (N,) of an image that is padded as for `means`: (N, channels)."""
        m, (_, wide, channels) = self.margin + 1, padded.shape
        stride = wide * channels
        out = np.empty((len(rows), channels), np.float32)
        starts = (rows + m) * stride + (columns + m) * channels
        _means_at(padded.ravel(), starts, self._taps(stride, channels), self.root, out)
        return out

"""Colours of a patch by generalised moments: how its colour channels vary together."""

import numpy as np
import numpy.typing as npt

from omninav.pipeline.engine.compiled import compiled
from omninav.stages.geometry.arrays import Array, Bools, Floats
from omninav.stages.values.image import Pixels

PAIRS = ((2, 1), (2, 0), (1, 0))
"""Red with green, red with blue, green with blue: channels of a blue-green-red image."""


@compiled(nogil=True)
def add_pixel(sums: Array, blue: float, green: float, red: float) -> None:
    """One more pixel in the ten sums of a patch: 1, b, g, r, bb, gg, rr, rg, rb, gb."""
    sums[0] += 1.0
    sums[1] += blue
    sums[2] += green
    sums[3] += red
    sums[4] += blue * blue
    sums[5] += green * green
    sums[6] += red * red
    sums[7] += red * green
    sums[8] += red * blue
    sums[9] += green * blue


@compiled(nogil=True)
def correlations(sums: Array, out: Floats) -> None:
    """C_RG, C_RB, C_GB of a patch's ten sums into `out` (3,); 0 where a channel does not vary.

    C_PQ = int P'Q' / sqrt(int P'^2 int Q'^2), P' = P - mean, in [-1, 1], which neither offset nor scale of a channel
    changes. Equation 1 as printed divides by the integrals of the centralised channels, which are 0 (erratum 25 in
    docs/papers.md).
    """
    number = max(sums[0], 1.0)
    blue = sums[4] - sums[1] * sums[1] / number
    green = sums[5] - sums[2] * sums[2] / number
    red = sums[6] - sums[3] * sums[3] / number
    rounding = 1e-6 * number  # a smaller variance of whole numbers in 0..255 is rounding
    rg, rb, gb = red * green, red * blue, green * blue
    flat_r, flat_g, flat_b = red <= rounding, green <= rounding, blue <= rounding
    out[0] = 0.0 if flat_r or flat_g else (sums[7] - sums[3] * sums[2] / number) / np.sqrt(rg)
    out[1] = 0.0 if flat_r or flat_b else (sums[8] - sums[3] * sums[1] / number) / np.sqrt(rb)
    out[2] = 0.0 if flat_g or flat_b else (sums[9] - sums[2] * sums[1] / number) / np.sqrt(gb)


@compiled(nogil=True)
def _disc_colours(pixels: Pixels, seen: Bools, points: Array, radii: Array, out: Floats) -> None:
    rows, columns = seen.shape
    sums = np.empty(10)
    for n in range(len(points)):
        sums[:] = 0.0
        radius = radii[n]
        step = max(1, int(radius / 8.0))  # some 200 pixels tell the colours of a large patch
        middle_x, middle_y = int(np.floor(points[n, 0] + 0.5)), int(np.floor(points[n, 1] + 0.5))
        steps = int(radius / step)
        for down in range(-steps, steps + 1):
            y = middle_y + down * step
            if y < 0 or y >= rows:
                continue
            for right in range(-steps, steps + 1):
                x = middle_x + right * step
                if x < 0 or x >= columns or not seen[y, x]:
                    continue
                if (right * right + down * down) * step * step <= radius * radius:
                    add_pixel(sums, float(pixels[y, x, 0]), float(pixels[y, x, 1]), float(pixels[y, x, 2]))
        correlations(sums, out[n])


def disc_colours(pixels: Pixels, seen: Bools, points: npt.ArrayLike, radii: npt.ArrayLike) -> Floats:
    """Colour correlations (N, 3) of discs around points (N, 2), columns and rows, with radii (N,), in pixels.

    `pixels` (rows, columns, 3) uint8 blue-green-red; only pixels with `seen` (rows, columns) count.
    """
    points, radii = np.asarray(points, np.float64).reshape(-1, 2), np.asarray(radii, np.float64)
    out = np.empty((len(points), 3), np.float32)
    _disc_colours(pixels, seen, points, radii, out)
    return out


def image_colours(pixels: Pixels, seen: Bools) -> Floats:
    """Colour correlations (3,) of all pixels with `seen` (rows, columns)."""
    chosen = pixels[seen].astype(np.float64)
    sums = np.concatenate([[len(chosen)], chosen.sum(axis=0), (chosen**2).sum(axis=0)])
    mixed = [float(chosen[:, one] @ chosen[:, other]) for one, other in PAIRS]
    out = np.empty(3, np.float32)
    correlations(np.concatenate([sums, mixed]), out)
    return out

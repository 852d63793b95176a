"""Which points of a line are drawn: as many as the eye tells apart, however long the run was."""

from itertools import pairwise

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
STRETCHES = 1000
"""Stretches of a line that has more than four points for each."""


def drawn_points(pixels: Array) -> Array:
    """Those points of a line (N, 2) that are drawn; NaN interrupts it.

    What moves by less than a third of a pixel is left out. Of a line that is still too long, each stretch keeps its
    ends, its highest and its lowest point, and one interruption.
    """
    if len(pixels) <= 2:
        return pixels
    fine = np.round(np.nan_to_num(pixels, nan=-1e6) * 3)
    moved = np.append(True, (fine[1:] != fine[:-1]).any(axis=1))
    moved[-1] = True
    pixels = pixels[moved]
    if len(pixels) <= 4 * STRETCHES:
        return pixels
    known = np.asarray(np.isfinite(pixels).all(axis=1))
    kept = [len(pixels) - 1]
    lowest, highest = (np.where(known, pixels[:, 1], beyond) for beyond in (np.inf, -np.inf))
    for start, end in pairwise(np.linspace(0, len(pixels), STRETCHES + 1).astype(int).tolist()):
        kept += [start, end - 1, start + int(lowest[start:end].argmin()), start + int(highest[start:end].argmax())]
        kept += (start + np.flatnonzero(~known[start:end])[:1]).tolist()
    return pixels[np.unique(kept)]

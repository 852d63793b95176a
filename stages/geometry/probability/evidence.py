"""From similarities to evidence: how steep it is, and how much of a picture's is new."""

import math

import numba
import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
Floats = npt.NDArray[np.float32]


@numba.njit(cache=True, nogil=True)
def best_headings(values: Floats) -> Floats:
    """Each reference's similarity at its best heading: (references, headings) -> (references,)."""
    out = np.empty(len(values), np.float32)
    for n in range(len(values)):  # numpy's maximum along so short an axis takes ten times as long
        best = values[n, 0]
        for h in range(1, values.shape[1]):
            best = max(best, values[n, h])
        out[n] = best
    return out


def contrast_power(best: Floats, contrast: float, sampling_weight: Array | None = None) -> float:
    """The power p at which S^p differs by `contrast` nats for each standard deviation of log S.

    `best` (R,): each reference's similarity at its best heading. `sampling_weight` (R,): how many references of the map each
    stands for; None: one each.
    """
    logarithms = np.log(np.maximum(best, 1e-12)).astype(np.float64)
    centre = np.average(logarithms, weights=sampling_weight)
    spread = math.sqrt(float(np.average(np.square(logarithms - centre), weights=sampling_weight)))
    return contrast / max(spread, 1e-6)


def fresh_share(way: float | None, independent: float, standing: float) -> float:
    """Which share of a picture's evidence is new, in [standing, 1]: a picture taken at the same place says little more.

    `way`: metres since the picture before, None where it is not known; from `independent` metres on all is new, and
    with 0 always.
    """
    if way is None or independent <= 0.0:
        return 1.0
    return min(1.0, max(standing, way / independent))

"""Turn of a robot from two panoramas: a visual compass."""

import itertools
import math

import numpy as np
import numpy.typing as npt

from omninav.stages.geometry.arrays import Floats


def turn_between(before: Floats, after: Floats) -> float:
    """The turn (rad, counter-clockwise) between two panoramas (rows, columns) of grey levels.

    The shift of the columns at which they correlate best around the full circle, summed over rows; between columns by
    a parabola through the three highest. Each row counts from its mean, so that light which changes evenly does not
    matter. Zeil, Hofmann & Chahl 2003, "Catchment areas of panoramic snapshots in outdoor scenes", JOSA A 20(3),
    section 3 use the same image difference; for what is far away the turn is exact, however far the robot drove.
    """
    return turns_and_correlations(np.stack([before, after]))[0][0]


def turns_and_correlations(strips: Floats) -> tuple[list[float], list[float]]:
    """Turns and correlations of successive panoramas (N, rows, columns): N - 1 of each.

    A turn is what `turn_between` finds; the correlation at that turn is 1 where the two are equal.
    """
    views = strips - strips.mean(axis=2, keepdims=True)
    spectra = np.fft.rfft(views)
    likeness = np.fft.irfft((np.conj(spectra[:-1]) * spectra[1:]).sum(axis=1), strips.shape[2])
    energies = [float(np.square(view).sum(dtype=np.float64)) for view in views]
    most = [math.sqrt(one * other) for one, other in itertools.pairwise(energies)]
    correlations = [float(each.max()) / energy if energy else 0.0 for each, energy in zip(likeness, most, strict=True)]
    return [angle_of_peak(each) for each in likeness], correlations


def angle_of_peak(values: npt.NDArray[np.floating]) -> float:
    """The angle (rad) at which values around the full circle are largest, between samples by a parabola."""
    number, best = len(values), int(values.argmax())
    left, middle, right = float(values[best - 1]), float(values[best]), float(values[(best + 1) % number])
    bend = left - 2.0 * middle + right
    shift = best + (0.5 * (left - right) / bend if bend < 0.0 else 0.0)
    return math.remainder(2.0 * math.pi * shift / number, 2.0 * math.pi)

"""Turn of a robot from two panoramas: a visual compass."""

import math

import numpy as np
import numpy.typing as npt

Strip = npt.NDArray[np.float32]


def turn_between(before: Strip, after: Strip) -> float:
    """The turn (rad, counter-clockwise) between two panoramas (rows, columns) of grey levels.

    The shift of the columns at which they correlate best around the full circle, summed over rows; between columns by
    a parabola through the three highest. Each row counts from its mean, so that light which changes evenly does not
    matter. Zeil, Hofmann & Chahl 2003, "Catchment areas of panoramic snapshots in outdoor scenes", JOSA A 20(3),
    section 3 use the same image difference; for what is far away the turn is exact, whatever the robot drove meanwhile.
    """
    return angle_of_peak(_likeness(*(view - view.mean(axis=1, keepdims=True) for view in (before, after))))


def turn_and_correlation(before: Strip, after: Strip) -> tuple[float, float]:
    """The turn as `turn_between` finds it, and the correlation of the two panoramas there: 1 where they are equal."""
    one, other = (view - view.mean(axis=1, keepdims=True) for view in (before, after))
    likeness = _likeness(one, other)
    energy = float(np.sqrt(np.square(one).sum(dtype=np.float64) * np.square(other).sum(dtype=np.float64)))
    return angle_of_peak(likeness), float(likeness.max()) / energy if energy else 0.0


def _likeness(one: Strip, other: Strip) -> npt.NDArray[np.floating]:
    spectra = [np.fft.rfft(view) for view in (one, other)]
    return np.fft.irfft((np.conj(spectra[0]) * spectra[1]).sum(axis=0), one.shape[1])


def angle_of_peak(values: npt.NDArray[np.floating]) -> float:
    """The angle (rad) at which values around the full circle are largest, between samples by a parabola."""
    number, best = len(values), int(np.argmax(values))
    left, middle, right = (float(values[(best + offset) % number]) for offset in (-1, 0, 1))
    bend = left - 2.0 * middle + right
    shift = best + (0.5 * (left - right) / bend if bend < 0.0 else 0.0)
    return math.remainder(2.0 * math.pi * shift / number, 2.0 * math.pi)

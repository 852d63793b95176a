"""How far a robot has turned, from two panoramas: a visual compass."""

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
    columns = before.shape[1]
    spectra = [np.fft.rfft(view - view.mean(axis=1, keepdims=True)) for view in (before, after)]
    likeness = np.fft.irfft((np.conj(spectra[0]) * spectra[1]).sum(axis=0), columns)
    return angle_of_peak(likeness)


def angle_of_peak(values: npt.NDArray[np.floating]) -> float:
    """The angle (rad) at which values around the full circle are largest, between samples by a parabola."""
    number, best = len(values), int(np.argmax(values))
    left, middle, right = (float(values[(best + offset) % number]) for offset in (-1, 0, 1))
    bend = left - 2.0 * middle + right
    shift = best + (0.5 * (left - right) / bend if bend < 0.0 else 0.0)
    return math.remainder(2.0 * math.pi * shift / number, 2.0 * math.pi)

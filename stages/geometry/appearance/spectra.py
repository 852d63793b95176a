"""Spectra around the robot: magnitudes, which do not change when it turns, and the turn between two."""

import math

import numpy as np

from omninav.pipeline.engine.compiled import compiled
from omninav.stages.geometry.arrays import Array, Complex, Floats
from omninav.stages.geometry.plane.se2 import wrap

from .rotated_distances import angles_of_least


def packed(spectrum: Complex) -> Floats:
    """A spectrum (channels, frequencies) as one vector: all real parts, then all imaginary ones."""
    return np.concatenate([spectrum.real.ravel(), spectrum.imag.ravel()]).astype(np.float32)


def unpacked(vectors: Floats, channels: int) -> Complex:
    """Inverse of `packed`: vectors (..., D) to spectra (..., channels, frequencies)."""
    half = vectors.shape[-1] // 2
    values = vectors[..., :half].astype(np.float64) + 1j * vectors[..., half:].astype(np.float64)
    return values.reshape(*vectors.shape[:-1], channels, half // channels)


def spectral_distances(values: Floats, kept: Floats, channels: int, segments: int) -> Array:
    """Euclidean distance between the magnitudes of two spectra's coefficients, (D,) and (R, D): (R,).

    In the unit of the samples: the root of the summed squares over channels and segments of two signals that differ in
    these magnitudes (Parseval; each frequency but the lowest and the half of an even number of segments represents
    two).
    """
    half = values.shape[-1] // 2
    share = np.tile(_share(half // channels, segments), channels).astype(np.float32)
    return _size_distances(values, np.ascontiguousarray(kept), share)


@compiled(nogil=True, fastmath={"reassoc"})
def _size_distances(values: Floats, kept: Floats, share: Floats) -> Array:
    # One pass in single precision: five times as fast as arrays of complex numbers over a whole map.
    half = len(share)
    here = np.sqrt(values[:half] ** 2 + values[half:] ** 2)
    there = np.empty(half, np.float32)
    distances = np.empty(len(kept))
    for row in range(len(kept)):
        for k in range(half):
            there[k] = np.sqrt(kept[row, k] * kept[row, k] + kept[row, half + k] * kept[row, half + k])
        total = np.float32(0.0)
        for k in range(half):
            total += share[k] * (there[k] - here[k]) * (there[k] - here[k])
        distances[row] = math.sqrt(total)
    return distances


def best_turns(values: Floats, kept: Floats, channels: int, segments: int, steps: int = 360) -> Array:
    """The robot's turn, counter-clockwise, from its heading in each kept view (R, D): (R,) rad.

    The greatest circular cross-correlation of the two signals, over all channels, at `steps` turns; between them by the
    parabola through the three values around the greatest. Samples run clockwise around the robot (as a panorama's
    columns): a robot turned by t sees what it saw at azimuth a now at azimuth a - t, further on by t.
    """
    here, there = unpacked(values, channels), unpacked(kept, channels)
    frequencies = here.shape[-1]
    against = -(_share(frequencies, segments) * np.conj(there) * here).sum(axis=-2)
    # A signal delayed by t has coefficient k turned by exp(-i k t): the correlation at t is -sum Re(against e^{ikt}).
    angles = 2.0 * math.pi * np.arange(steps) / steps
    waves = np.exp(1j * np.outer(np.arange(frequencies), angles))
    return wrap(angles_of_least((against @ waves).real))


def _share(frequencies: int, segments: int) -> Array:
    # How much of the signal's energy a coefficient represents, for a spectrum divided by sqrt(segments).
    share = np.full(frequencies, 2.0)
    share[0] = 1.0
    if segments % 2 == 0 and frequencies == segments // 2 + 1:
        share[-1] = 1.0
    return share

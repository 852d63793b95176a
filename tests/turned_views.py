"""Measures the turns between successive panoramas from their pixels alone."""

import numpy as np
import numpy.typing as npt


def columns_moved(grey: npt.NDArray[np.uint8]) -> npt.NDArray[np.int64]:
    """Columns by which each panorama (N, height, columns) fits best when it is moved to the right: (N - 1,)."""
    columns = grey.shape[2]
    spectra = np.fft.fft(grey.astype(float), axis=2)
    spectra[..., 0] = 0.0
    match = np.fft.ifft(spectra[1:] * np.conj(spectra[:-1]), axis=2).real.sum(axis=1)
    moved: npt.NDArray[np.int64] = (np.argmax(match, axis=1) + columns // 2) % columns - columns // 2
    return moved

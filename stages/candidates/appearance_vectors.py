"""Views as vectors whose distance says how similar they are, and the few dimensions in which a map's views differ."""

import numpy as np
import numpy.typing as npt

from omninav.stages.geometry.appearance.segments import FeatureKind

Floats = npt.NDArray[np.float32]


def appearance_vectors(views: Floats, kind: FeatureKind) -> Floats:
    """Views (N, segments, bins) as vectors (N, segments x bins) float32 of length 1 or less.

    Of histograms the square roots, so that the distance is Hellinger's; of colours the colours, of descriptors the
    descriptors.
    """
    flat = np.asarray(views, np.float32).reshape(len(views), -1)
    if kind == "histograms":
        flat = np.sqrt(np.maximum(flat, 0.0))
    scale = np.float32(1.0 / np.sqrt(views.shape[1]) / (np.sqrt(3.0) * 255.0 if kind == "colours" else 1.0))
    return np.asarray(flat * scale, np.float32)


def principal_axes(vectors: Floats, dimensions: int) -> tuple[Floats, Floats]:
    """Mean (D,) of vectors (N, D), and the directions (D, dimensions) in which they vary most, that of most first.

    There are no more directions than D, and their number is even: one more is zero where it has to be.
    """
    mean = vectors.mean(axis=0, dtype=np.float64)
    centred = vectors - mean
    _, directions = np.linalg.eigh(centred.T @ centred)
    found = directions[:, ::-1][:, :dimensions]
    axes = np.zeros((vectors.shape[1], found.shape[1] + found.shape[1] % 2), np.float32)
    axes[:, : found.shape[1]] = found
    return mean.astype(np.float32), axes

"""Whitening: vectors brought to mean zero and equal variance in all directions, as learned from some of them."""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from omninav.stages.geometry.arrays import Floats

SHRINKAGE = 0.01
"""Share of the mean variance that is added to each, so that directions without any are not blown up."""


class Whitening(NamedTuple):
    """`mean` (D,) is subtracted, and the rest multiplied by `weights` (D, K), strongest direction first."""

    mean: Floats
    weights: Floats

    def of(self, vectors: Floats) -> Floats:
        """Vectors (..., D), whitened and brought to length 1: (..., K) float32; zeros stay zeros."""
        white = (vectors - self.mean) @ self.weights
        lengths = np.linalg.norm(white, axis=-1, keepdims=True)
        return np.asarray(white / np.where(lengths > 0.0, lengths, 1.0), np.float32)


def learned_whitening(vectors: npt.NDArray[np.floating], components: int) -> Whitening:
    """Whitening by the K strongest principal components of vectors (N, D); K is at most D.

    Jégou & Chum 2012 (Negative evidences and co-occurrences in image retrieval: the benefit of PCA and whitening). A
    component's largest number is positive.
    """
    values = vectors.astype(np.float64)
    mean = values.mean(axis=0)
    centred = values - mean
    variances, directions = np.linalg.eigh(centred.T @ centred / len(values))
    strongest = np.argsort(-variances, kind="stable")[:components]
    axes = directions[:, strongest]
    axes = axes * np.sign(np.take_along_axis(axes, np.abs(axes).argmax(axis=0)[None], axis=0))
    weights = axes / np.sqrt(np.maximum(variances[strongest], 0.0) + SHRINKAGE * variances.mean() + 1e-12)
    return Whitening(mean.astype(np.float32), weights.astype(np.float32))

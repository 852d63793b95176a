"""Views as vectors whose distance measures their similarity, and the few dimensions in which a map's views differ."""

from collections.abc import Iterator

import numpy as np

from omninav.stages.geometry.appearance.segments import FeatureKind
from omninav.stages.geometry.arrays import Floats
from omninav.stages.values.maps import ReferenceGraph

SAMPLE = 1 << 14
"""References, evenly over the map, from which principal axes are learned."""
BLOCK = 1 << 13
"""References that are read at once."""


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


def sample(map: ReferenceGraph, references: int, number: int = SAMPLE) -> Floats:
    """Vectors of `number` of the first `references` of a map at even steps."""
    rows = np.unique(np.linspace(0, references - 1, min(number, references)).astype(np.int64))
    return appearance_vectors(map.features[rows], map.kind)


def blocks(map: ReferenceGraph, first: int, last: int) -> Iterator[tuple[slice, Floats]]:
    """Vectors of the references `first` to `last` of a map, a block after the other."""
    for start in range(first, last, BLOCK):
        rows = slice(start, min(start + BLOCK, last))
        yield rows, appearance_vectors(map.features[rows], map.kind)

"""Finds the references most similar to a view by comparing the short vectors of all."""

import numpy as np

from omninav.stages.geometry.arrays import Floats, Ints
from omninav.stages.values.maps import ReferenceGraph
from omninav.stages.values.reference_index import ShortVectors

from .appearance_vectors import BLOCK, blocks, principal_axes, sample


def short_vectors(map: ReferenceGraph, references: int, dimensions: int) -> ShortVectors:
    """The index of the first `references` of a map, in `dimensions` at most."""
    mean, axes = principal_axes(sample(map, references), dimensions)
    found = [np.asarray((vectors - mean) @ axes, np.float32) for _, vectors in blocks(map, 0, references)]
    return ShortVectors(mean, axes, np.concatenate(found))


class ExactSearch:
    """Short vectors made ready to be asked, for a map that may have grown since they were made."""

    def __init__(self, index: ShortVectors) -> None:
        self.index = index
        self._take(index.vectors)

    def __len__(self) -> int:
        return len(self._vectors)

    def append(self, map: ReferenceGraph) -> None:
        """Take in the references that a map has more than the index."""
        for _, vectors in blocks(map, len(self), len(map)):
            self._take(np.concatenate([self._vectors, self._short(vectors)]))

    def nearest(self, vectors: Floats, number: int, lists: int = 0) -> Ints:
        """The `number` references nearest to any of the vectors (Q, D), ascending; there are no `lists` to look in.

        What the short vectors leave out of a query counts too: it tells turns of a view that are like nothing in the
        map from one that is.
        """
        squares, short = np.square(vectors - self.index.mean).sum(axis=1, keepdims=True), self._short(vectors)
        parts = [self._vectors[start : start + BLOCK] for start in range(0, len(self), BLOCK)]
        gaps = np.concatenate([(squares - 2.0 * (short @ part.T)).min(axis=0) for part in parts]) + self._squares
        if number >= len(gaps):
            return np.arange(len(gaps))
        return np.sort(np.argpartition(gaps, number)[:number])

    def _take(self, vectors: Floats) -> None:
        self._vectors, self._squares = vectors, np.square(vectors).sum(axis=1)

    def _short(self, vectors: Floats) -> Floats:
        return np.asarray((vectors - self.index.mean) @ self.index.axes, np.float32)

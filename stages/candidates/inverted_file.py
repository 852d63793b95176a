"""Builds and searches an index of a map's references, with faiss.

faiss reads files without checking them, so none of its files is ever read: an index is kept as plain arrays, and is put
together again from them.
"""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt

from omninav.stages.geometry.arrays import Bytes, Floats, Ints
from omninav.stages.values.maps import ReferenceGraph
from omninav.stages.values.reference_index import InvertedLists

from .appearance_vectors import blocks, principal_axes, sample

SEED = 1
"""Seed of the training of centroids and codebooks."""
TRAINING_SAMPLE = 1 << 16
"""References, evenly over the map, from which centroids and codebooks are learned."""
MAX_LISTS = 1 << 15
PER_TURN = 4
"""At most 1 / PER_TURN of the candidates come from a single heading, since few headings resemble the map at all."""


def faiss_or_none() -> Any:
    """The library, on one thread: jobs share the processors, and the same sums give the same bytes. None: missing."""
    try:
        import faiss
    except ImportError:
        return None
    faiss.omp_set_num_threads(1)
    return faiss


def build(
    faiss: Any, map: ReferenceGraph, references: int, dimensions: int, progress: Callable[[int, int | None], None]
) -> InvertedLists:
    """The index of the first `references` of a map, in `dimensions` at most."""
    mean, axes = principal_axes(sample(map, references), dimensions)
    short = axes.shape[1]
    number = min(1 << round(math.log2(max(math.sqrt(references), 1.0))), MAX_LISTS)
    lists = faiss.IndexFlatL2(short)
    trained = faiss.IndexIVFPQ(lists, short, number, short // 2, 4)
    trained.verbose = False
    for quantiser in (trained.cp, trained.pq.cp):
        quantiser.seed, quantiser.min_points_per_centroid = SEED, 1
    trained.cp.max_points_per_centroid = 1 << 8
    trained.train((sample(map, references, TRAINING_SAMPLE) - mean) @ axes)
    codebooks = faiss.vector_to_array(trained.pq.centroids).reshape(short // 2, 16, 2)
    found, codes = np.empty(references, np.int32), np.empty((references, trained.code_size), np.uint8)
    for rows, vectors in blocks(map, 0, references):
        encoded = trained.sa_encode((vectors - mean) @ axes)
        found[rows], codes[rows] = _split(encoded, trained.coarse_code_size())
        progress(rows.stop, references)
    return InvertedLists(mean, axes, lists.reconstruct_n(0, number), codebooks.copy(), found, codes)


class InvertedFile:
    """An index made ready to be asked, for a map that may have grown since it was built."""

    def __init__(self, faiss: Any, index: InvertedLists) -> None:
        self.index, self._faiss = index, faiss
        number, short = index.centroids.shape
        lists = faiss.IndexFlatL2(short)
        lists.add(np.ascontiguousarray(index.centroids))
        plain = faiss.IndexIVFPQ(lists, short, number, short // 2, 4)
        faiss.copy_array_to_vector(np.ascontiguousarray(index.codebooks).ravel(), plain.pq.centroids)
        plain.is_trained, plain.use_precomputed_table = True, 0
        plain.add_sa_codes(_joined(index.lists, index.codes, plain.coarse_code_size()))
        self._lists = lists  # faiss keeps no hold of it
        self._file = faiss.IndexIVFPQFastScan(plain)

    def __len__(self) -> int:
        return int(self._file.ntotal)

    def append(self, map: ReferenceGraph) -> None:
        """Take in the references that a map has more than the index."""
        for _, vectors in blocks(map, len(self), len(map)):
            self._file.add(self._short(vectors))

    def nearest(self, vectors: Floats, number: int, lists: int) -> Ints:
        """The `number` references nearest to any of the vectors (Q, D), ascending; looked for in that many lists each.

        What the short vectors leave out of a query counts too: it tells turns of a view that are like nothing in the
        map from one that is.
        """
        short = np.ascontiguousarray(self._short(vectors))
        left_out = np.square(vectors - self.index.mean).sum(axis=1) - np.square(short).sum(axis=1)
        options = self._faiss.SearchParametersIVF(nprobe=min(lists, len(self.index.centroids)))
        each = min(max(number // PER_TURN, min(number, 64)), len(self))
        distances, found = self._file.search(short, each, params=options)
        distances, found = (distances + left_out[:, None])[found >= 0], found[found >= 0]
        order = np.lexsort((found, distances))
        _, first = np.unique(found[order], return_index=True)
        return np.sort(found[order][np.sort(first)[:number]])

    def _short(self, vectors: Floats) -> Floats:
        return np.asarray((vectors - self.index.mean) @ self.index.axes, np.float32)


def _split(encoded: Bytes, width: int) -> tuple[npt.NDArray[np.int32], Bytes]:
    # The number of the list in the first bytes, the lowest first, then the code.
    lists = np.zeros(len(encoded), np.int32)
    for byte in range(width):
        lists |= encoded[:, byte].astype(np.int32) << (8 * byte)
    return lists, encoded[:, width:]


def _joined(lists: npt.NDArray[np.int32], codes: Bytes, width: int) -> Bytes:
    numbers = [(lists >> (8 * byte)).astype(np.uint8) for byte in range(width)]
    return np.column_stack([*numbers, codes])

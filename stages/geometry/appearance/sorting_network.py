"""Sorting by exchanges in a fixed order."""

import functools

import numpy as np

from omninav.stages.geometry.arrays import Ints


@functools.cache
def sorting_network(length: int) -> Ints:
    """Pairs (i, j), i < j, whose exchange in this order sorts `length` items: Batcher's odd-even merge sort. (P, 2)."""
    pairs = []
    p = 1
    while p < length:
        k = p
        while k >= 1:
            for j in range(k % p, length - k, 2 * k):
                for i in range(min(k, length - j - k)):
                    if (i + j) // (2 * p) == (i + j + k) // (2 * p):
                        pairs.append((i + j, i + j + k))
            k //= 2
        p *= 2
    return np.array(pairs, dtype=np.int64).reshape(-1, 2)

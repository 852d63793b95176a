"""Distances over a graph of places, in links."""

import numpy as np
from scipy.sparse.csgraph import shortest_path

from omninav.stages.geometry.arrays import Array, Ints


def links_between(links: Ints, places: int) -> Array:
    """Number of links of the shortest path between any two places: (P, P), inf where there is none.

    `links` (L, 2): neighbouring places, whichever way round.
    """
    one, other = np.asarray(links, np.int64).reshape(-1, 2).T
    beside = np.zeros((places, places))
    beside[one, other] = beside[other, one] = 1.0
    return np.asarray(shortest_path(beside, directed=False, unweighted=True))

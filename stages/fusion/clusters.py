"""Poses that lie close together."""

from typing import Any

import numpy as np

from omninav.stages.geometry.arrays import Array, Ints
from omninav.stages.geometry.probability.particles import NEIGHBOUR_STEPS


def clusters(poses: Array, metres: float, radians: float) -> Ints:
    """The cluster of each pose (N, 3): (N,), numbered in the order of their cells, from left to right.

    Cells are `metres` square and about `radians` high in heading, which goes round; cells with a pose that touch, by a
    face, an edge or a corner, are of one cluster.
    """
    from scipy.sparse import coo_matrix  # slow to import: not before a run
    from scipy.sparse.csgraph import connected_components

    headings = max(3, round(2 * np.pi / radians))
    turn = np.floor(np.mod(poses[:, 2], 2 * np.pi) * (headings / (2 * np.pi))).astype(np.int64) % headings
    column, row = (np.floor(poses[:, axis] / metres).astype(np.int64) for axis in (0, 1))
    column, row = column - column.min() + 1, row - row.min() + 1
    width = int(row.max()) + 2
    cells, inverse = np.unique((column * width + row) * headings + turn, return_inverse=True)
    column, row, turn = cells // headings // width, cells // headings % width, cells % headings
    a, b, c = NEIGHBOUR_STEPS
    beside = ((column[:, None] + a) * width + row[:, None] + b) * headings + (turn[:, None] + c) % headings
    found = np.minimum(np.searchsorted(cells, beside), len(cells) - 1)
    one, other = np.nonzero(cells[found] == beside)
    pairs = (np.ones(len(one), np.int8), (one, found[one, other]))
    joined: Any = coo_matrix(pairs, shape=(len(cells), len(cells)))
    labels = connected_components(joined, directed=False)[1]
    label: Ints = labels[inverse.ravel()].astype(np.int64)
    return label

"""Summarises particles as a few Gaussians."""

import math
from typing import Any

import numpy as np

from omninav.pipeline import Context, Outputs, Stage
from omninav.stages.geometry.arrays import Array, Ints
from omninav.stages.geometry.probability.gaussians import floored
from omninav.stages.geometry.probability.particles import NEIGHBOUR_STEPS, weighted_moments
from omninav.stages.values.belief import GaussianMixture, Particles

CELL_M = 0.5
"""Width of a cell, metres."""
CELL_DEG = 30.0
"""Height of a cell in heading, degrees."""
MIN_WEIGHT = 0.01
"""Weight below which a cluster is dropped."""
MIN_SIGMA_M = 0.01
"""Smallest standard deviation of a Gaussian, metres: equal particles have no spread (erratum 18 in docs/papers.md)."""
MIN_SIGMA_DEG = 0.5
"""Smallest standard deviation of its heading, degrees."""


class ParticleClustering(Stage):
    """Replaces each cluster of particles by a Gaussian with its mean, covariance and weight.

    Porta & Kroese 2004, section 3.2. Particles belong to one cluster where their cells of `cell_m` x `cell_m` x
    `CELL_DEG` touch, directly or over other occupied cells, so that a cluster has any shape. The heading's mean is
    circular. Weights are normalised to sum 1. No Gaussian where no cluster is heavy enough: the pose is unknown.
    """

    class Out(Outputs):
        """The belief as Gaussians, the heaviest first; none where no cluster is heavy enough."""

        state: GaussianMixture

    def step(self, ctx: Context, particles: Particles) -> Out:
        floor = (MIN_SIGMA_M, MIN_SIGMA_M, math.radians(MIN_SIGMA_DEG))
        labels = clusters(particles.poses, CELL_M, math.radians(CELL_DEG))
        weights = np.bincount(labels, weights=particles.weights) / float(particles.weights.sum())
        chosen = [n for n in np.argsort(-weights, kind="stable") if weights[n] >= MIN_WEIGHT]
        means, covariances = np.empty((len(chosen), 3)), np.empty((len(chosen), 3, 3))
        for row, cluster in enumerate(chosen):
            members = labels == cluster
            means[row], covariance = weighted_moments(particles.poses[members], particles.weights[members])
            covariances[row] = floored(covariance, floor)
        kept = weights[chosen]
        return self.Out(state=GaussianMixture(means, covariances, kept / kept.sum()))


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
    return np.asarray(labels[inverse.ravel()], np.int64)

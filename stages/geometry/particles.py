"""Weighted pose samples: moments and modes."""

import itertools
from typing import Any

import numba
import numpy as np
import numpy.typing as npt
from scipy.spatial import KDTree

from .se2 import wrap

Array = npt.NDArray[np.float64]


def weighted_moments(poses: Array, weights: Array) -> tuple[Array, Array]:
    """Mean pose (3,) and covariance (3, 3) of weighted poses (N, 3); the heading's mean is circular."""
    share = weights / weights.sum()
    heading = np.arctan2(share @ np.sin(poses[:, 2]), share @ np.cos(poses[:, 2]))
    mean = np.array([share @ poses[:, 0], share @ poses[:, 1], heading])
    spread = poses - mean
    spread[:, 2] = wrap(spread[:, 2])
    return mean, (spread * share[:, None]).T @ spread


def heaviest_mode(poses: Array, weights: Array, radius: float = 1.0) -> tuple[Array, Array, float]:
    """The heaviest mode of weighted poses: its mean (3,), covariance (3, 3) and share of the weight.

    The plane is cut into cells of `radius` / 2 (m) and 12 headings; the heaviest cell, summed with its neighbours,
    starts a mean shift with a flat kernel of `radius` metres and 30 degrees that stops when its members stay the same.
    """
    cell = radius / 2
    columns, rows = (np.floor(poses[:, axis] / cell).astype(np.int64) for axis in (0, 1))
    turns = np.mod(np.floor(np.mod(poses[:, 2], 2 * np.pi) / (np.pi / 6)).astype(np.int64), 12)
    left, low = columns.min() - 1, rows.min() - 1
    width = rows.max() - low + 2
    cells, inverse = np.unique(((columns - left) * width + rows - low) * 12 + turns, return_inverse=True)
    mass = np.bincount(inverse.ravel(), weights=weights, minlength=len(cells))
    heaviest = cells[np.argsort(-mass, kind="stable")[:64]]  # a mode lighter than 64 others is not the heaviest
    column, row, turn = heaviest // 12 // width, heaviest // 12 % width, heaviest % 12
    around = np.zeros(len(heaviest))
    for a, b, c in itertools.product((-1, 0, 1), repeat=3):
        neighbour = ((column + a) * width + row + b) * 12 + (turn + c) % 12
        found = np.minimum(np.searchsorted(cells, neighbour), len(cells) - 1)
        around += np.where(cells[found] == neighbour, mass[found], 0.0)
    best = int(np.argmax(around))
    start = (column[best] + left, row[best] + low, turn[best])
    centre = np.array([(start[0] + 0.5) * cell, (start[1] + 0.5) * cell, wrap((start[2] + 0.5) * np.pi / 6)])
    members = np.zeros(len(poses), dtype=bool)
    for _ in range(20):
        near = np.hypot(poses[:, 0] - centre[0], poses[:, 1] - centre[1]) < radius
        near &= np.abs(wrap(poses[:, 2] - centre[2])) < np.pi / 6
        if not near.any() or np.array_equal(near, members) or weights[near].sum() <= 0:
            break
        members = near
        centre, _ = weighted_moments(poses[members], weights[members])
    if not members.any() or weights[members].sum() <= 0:
        members = np.ones(len(poses), dtype=bool)
    mean, covariance = weighted_moments(poses[members], weights[members])
    return mean, covariance, float(weights[members].sum() / weights.sum())


def effective_size(weights: Array) -> float:
    """How many equal particles carry as much information as these weights: (sum w)^2 / sum w^2."""
    return float(weights.sum() ** 2 / np.square(weights).sum())


def systematic(weights: Array, number: int, offset: float) -> npt.NDArray[np.int64]:
    """Indices of `number` particles drawn by weight with one comb of equal teeth: (number,), ascending.

    `offset` in [0, 1) places the comb. Particle i is drawn floor or ceil of number w_i times; unbiased for a uniform
    offset.
    """
    return _comb(weights, number, offset)


@numba.njit(cache=True, nogil=True)
def _comb(weights: Array, number: int, offset: float) -> npt.NDArray[np.int64]:
    out = np.empty(number, np.int64)
    step = weights.sum() / number
    at, reached, last = 0, weights[0], len(weights) - 1
    while weights[last] <= 0.0 and last > 0:  # rounding must not end on a particle without weight
        last -= 1
    for n in range(number):
        tooth = (n + offset) * step
        while reached <= tooth and at < last:
            at += 1
            reached += weights[at]
        out[n] = at
    return out


def occupied_cells(poses: Array, cell: float, angle: float) -> int:
    """Number of cells (`cell` metres square by about `angle` radians) that hold a pose."""
    headings = max(1, round(2 * np.pi / angle))
    x, y = np.floor(poses[:, 0] / cell).astype(np.int64), np.floor(poses[:, 1] / cell).astype(np.int64)
    z = np.floor(np.mod(poses[:, 2], 2 * np.pi) * (headings / (2 * np.pi))).astype(np.int64) % headings
    x, y = x - x.min(), y - y.min()
    return len(np.unique((x * (int(y.max()) + 1) + y) * headings + z))


def uniform_around(centres: Array, radius: float, number: int, rng: np.random.Generator) -> Array:
    """Poses (number, 3) uniform over the area within `radius` metres of any centre (R, >= 2), all headings alike."""
    tree: Any = KDTree(centres[:, :2])  # type: ignore[no-untyped-call]
    low, high = centres[:, :2].min(axis=0) - radius, centres[:, :2].max(axis=0) + radius
    cell = radius / 2
    columns, rows = (int(n) for n in np.ceil((high - low) / cell))
    corners = low + cell * np.stack(np.meshgrid(np.arange(columns), np.arange(rows), indexing="ij"), -1).reshape(-1, 2)
    reach = radius + cell * np.sqrt(0.5)
    corners = corners[np.isfinite(tree.query(corners + cell / 2, distance_upper_bound=reach)[0])]
    xy = np.empty((0, 2))
    while len(xy) < number:
        drawn = corners[rng.integers(len(corners), size=number)] + cell * rng.random((number, 2))
        xy = np.concatenate([xy, drawn[np.isfinite(tree.query(drawn, distance_upper_bound=radius)[0])]])
    return np.column_stack([xy[:number], rng.uniform(-np.pi, np.pi, number)])

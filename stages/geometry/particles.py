"""Weighted pose samples: moments and modes."""

import itertools
from typing import Any

import numba
import numpy as np
import numpy.typing as npt
from scipy.spatial import KDTree

from .se2 import wrap

Array = npt.NDArray[np.float64]

AROUND = np.array(list(itertools.product((-1, 0, 1), repeat=3)), np.int64).T
"""Steps to a cell itself and its 26 neighbours: (3, 27)."""


def weighted_moments(poses: Array, weights: Array) -> tuple[Array, Array]:
    """Mean pose (3,) and covariance (3, 3) of weighted poses (N, 3); the heading's mean is circular."""
    mean = weighted_mean(poses, weights)
    return mean, _covariance(np.ascontiguousarray(poses, np.float64), np.ascontiguousarray(weights, np.float64), mean)


def weighted_mean(poses: Array, weights: Array) -> Array:
    """Mean pose (3,) of weighted poses (N, 3); the heading's mean is circular."""
    return _mean(np.ascontiguousarray(poses, np.float64), np.ascontiguousarray(weights, np.float64))


@numba.njit(cache=True, nogil=True)
def _mean(poses: Array, weights: Array) -> Array:
    mean = np.zeros(3)
    total = sine = cosine = 0.0
    for n in range(len(poses)):
        total += weights[n]
        mean[0] += weights[n] * poses[n, 0]
        mean[1] += weights[n] * poses[n, 1]
        sine += weights[n] * np.sin(poses[n, 2])
        cosine += weights[n] * np.cos(poses[n, 2])
    mean[:2] /= total
    mean[2] = np.arctan2(sine, cosine)
    return mean


@numba.njit(cache=True, nogil=True)
def _covariance(poses: Array, weights: Array, mean: Array) -> Array:
    covariance = np.zeros((3, 3))
    total = 0.0
    for n in range(len(poses)):
        total += weights[n]
        x, y, turn = poses[n, 0] - mean[0], poses[n, 1] - mean[1], poses[n, 2] - mean[2]
        turn -= 2 * np.pi * np.floor((turn + np.pi) / (2 * np.pi))
        covariance[0, 0] += weights[n] * x * x
        covariance[0, 1] += weights[n] * x * y
        covariance[0, 2] += weights[n] * x * turn
        covariance[1, 1] += weights[n] * y * y
        covariance[1, 2] += weights[n] * y * turn
        covariance[2, 2] += weights[n] * turn * turn
    covariance[1, 0], covariance[2, 0], covariance[2, 1] = covariance[0, 1], covariance[0, 2], covariance[1, 2]
    return covariance / total


def heaviest_mode(poses: Array, weights: Array, radius: float = 1.0) -> tuple[Array, Array, float]:
    """The heaviest mode of weighted poses: its mean (3,), covariance (3, 3) and share of the weight.

    The plane is cut into cells of `radius` / 2 (m) and 12 headings; the heaviest cell, summed with its neighbours,
    starts a mean shift with a flat kernel of `radius` metres and 30 degrees that stops when its members stay the same.
    """
    poses, weights = np.ascontiguousarray(poses, np.float64), np.ascontiguousarray(weights, np.float64)
    cell = radius / 2
    left, low = (int(n) - 1 for n in np.floor(poses[:, :2].min(axis=0) / cell))
    width = int(np.floor(poses[:, 1].max() / cell)) - low + 2
    cells, inverse = np.unique(_cell_numbers(poses, cell, left, low, width), return_inverse=True)
    mass = np.bincount(inverse.ravel(), weights=weights, minlength=len(cells))
    heaviest = cells[np.argsort(-mass, kind="stable")[:64]]  # a mode lighter than 64 others is not the heaviest
    column, row, turn = heaviest // 12 // width, heaviest // 12 % width, heaviest % 12
    a, b, c = AROUND
    neighbour = ((column[:, None] + a) * width + row[:, None] + b) * 12 + (turn[:, None] + c) % 12
    found = np.minimum(np.searchsorted(cells, neighbour), len(cells) - 1)
    around = np.where(cells[found] == neighbour, mass[found], 0.0).sum(axis=1)
    best = int(np.argmax(around))
    start = (column[best] + left, row[best] + low, turn[best])
    centre = np.array([(start[0] + 0.5) * cell, (start[1] + 0.5) * cell, wrap((start[2] + 0.5) * np.pi / 6)])
    members = _climb(poses, weights, centre, radius)
    mean, covariance = weighted_moments(poses[members], weights[members])
    return mean, covariance, float(weights[members].sum() / weights.sum())


@numba.njit(cache=True, nogil=True)
def _cell_numbers(poses: Array, cell: float, left: int, low: int, width: int) -> npt.NDArray[np.int64]:
    numbers = np.empty(len(poses), np.int64)
    for n in range(len(poses)):
        column, row = int(np.floor(poses[n, 0] / cell)) - left, int(np.floor(poses[n, 1] / cell)) - low
        numbers[n] = (column * width + row) * 12 + int(np.floor(poses[n, 2] / (np.pi / 6))) % 12
    return numbers


@numba.njit(cache=True, nogil=True)
def _climb(poses: Array, weights: Array, centre: Array, radius: float) -> npt.NDArray[np.bool_]:
    # Mean shift with a flat kernel; the particles it ends with, or all of them where it finds none.
    members = np.zeros(len(poses), np.bool_)
    sines, cosines = np.sin(poses[:, 2]), np.cos(poses[:, 2])
    least = np.cos(np.pi / 6)
    x, y, sine, cosine = centre[0], centre[1], np.sin(centre[2]), np.cos(centre[2])
    for _ in range(20):
        changed = False
        total = sum_x = sum_y = sum_sine = sum_cosine = 0.0
        for n in range(len(poses)):
            dx, dy = poses[n, 0] - x, poses[n, 1] - y
            near = dx * dx + dy * dy < radius * radius and cosines[n] * cosine + sines[n] * sine > least
            changed = changed or near != members[n]
            members[n] = near
            if near:
                total += weights[n]
                sum_x += weights[n] * poses[n, 0]
                sum_y += weights[n] * poses[n, 1]
                sum_sine += weights[n] * sines[n]
                sum_cosine += weights[n] * cosines[n]
        if total <= 0.0:
            members[:] = True
            break
        if not changed:
            break
        x, y, length = sum_x / total, sum_y / total, np.hypot(sum_sine, sum_cosine)
        sine, cosine = sum_sine / length, sum_cosine / length
    return members


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

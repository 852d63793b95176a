"""Weighted pose samples: moments and modes."""

import itertools
import math

import numpy as np

from omninav.pipeline.engine.compiled import compiled
from omninav.stages.geometry.arrays import Array, Bools, Ints, Shorts
from omninav.stages.geometry.plane.point_cells import distinct, have_a_point_within, sort_into_cells

NEIGHBOUR_STEPS = np.array(list(itertools.product((-1, 0, 1), repeat=3)), np.int64).T
"""Steps to a cell itself and its 26 neighbours: (3, 27)."""


def weighted_moments(poses: Array, weights: Array) -> tuple[Array, Array]:
    """Mean pose (3,) and covariance (3, 3) of weighted poses (N, 3); the heading's mean is circular."""
    poses, weights = np.ascontiguousarray(poses, np.float64), np.ascontiguousarray(weights, np.float64)
    everyone = np.ones(len(poses), np.bool_)
    mean, _ = _mean(poses, weights, np.sin(poses[:, 2]), np.cos(poses[:, 2]), everyone)
    return mean, _covariance(poses, weights, mean, everyone)


def is_narrow(poses: Array, weights: Array, sigma_m: float) -> bool:
    """True if the position of weighted poses (N, 3) has at most this standard deviation, or there are no poses."""
    if not len(poses):
        return True
    _, covariance = weighted_moments(poses, weights)
    return bool(covariance[0, 0] + covariance[1, 1] <= sigma_m**2)


def weighted_mean(poses: Array, weights: Array) -> Array:
    """Mean pose (3,) of weighted poses (N, 3); the heading's mean is circular."""
    poses, weights = np.ascontiguousarray(poses, np.float64), np.ascontiguousarray(weights, np.float64)
    return _mean(poses, weights, np.sin(poses[:, 2]), np.cos(poses[:, 2]), np.ones(len(poses), np.bool_))[0]


@compiled(nogil=True)
def _mean(poses: Array, weights: Array, sines: Array, cosines: Array, members: Bools) -> tuple[Array, float]:
    mean = np.zeros(3)
    total = sine = cosine = 0.0
    for n in range(len(poses)):
        if members[n]:
            total += weights[n]
            mean[0] += weights[n] * poses[n, 0]
            mean[1] += weights[n] * poses[n, 1]
            sine += weights[n] * sines[n]
            cosine += weights[n] * cosines[n]
    mean[:2] /= total
    mean[2] = np.arctan2(sine, cosine)
    return mean, total


@compiled(nogil=True)
def _covariance(poses: Array, weights: Array, mean: Array, members: Bools) -> Array:
    covariance = np.zeros((3, 3))
    total = 0.0
    for n in range(len(poses)):
        if members[n]:
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


def mode_and_mean(poses: Array, weights: Array, radius: float, angle: float) -> tuple[Array, Array, float, Array]:
    """The heaviest mode of weighted poses: its mean (3,), covariance (3, 3), share of the weight; and the mean of all.

    The plane is cut into cells of `radius` / 2 (m) and headings of about `angle` (rad); the heaviest cell, summed with
    its neighbours, starts a mean shift with a flat kernel of `radius` and `angle` that stops when its members stay the
    same.
    """
    poses, weights = np.ascontiguousarray(poses, np.float64), np.ascontiguousarray(weights, np.float64)
    sines, cosines = np.sin(poses[:, 2]), np.cos(poses[:, 2])  # numpy takes a tenth of the time that numba does
    means, covariance = np.empty((2, 3)), np.empty((3, 3))
    mass = _mode_and_mean(poses, weights, sines, cosines, radius, angle, means, covariance)
    return means[0], covariance, mass / float(np.add.reduce(weights)), means[1]


@compiled(nogil=True)
def _mode_and_mean(
    poses: Array,
    weights: Array,
    sines: Array,
    cosines: Array,
    radius: float,
    angle: float,
    means: Array,
    covariance: Array,
) -> float:
    start, heaviest, least = _heaviest_cell(poses, weights, radius / 2, max(1, round(2 * np.pi / angle)))
    members = _climb(poses, weights, sines, cosines, start, radius, angle)
    if weights[members].sum() < least:  # the heaviest cell of the neighbourhood is beyond the kernel
        members = _climb(poses, weights, sines, cosines, heaviest, radius, angle)
    means[0], mass = _mean(poses, weights, sines, cosines, members)
    covariance[:] = _covariance(poses, weights, means[0], members)
    members[:] = True
    means[1] = _mean(poses, weights, sines, cosines, members)[0]
    return mass


@compiled(nogil=True)
def are_within(poses: Array, pose: Array, metres: float, radians: float) -> Bools:
    """Tests whether each of poses (N, 3) is within a tolerance of a pose (3,): (N,)."""
    out = np.zeros(len(poses), np.bool_)
    for n in range(len(poses)):
        x, y = poses[n, 0] - pose[0], poses[n, 1] - pose[1]
        if x * x + y * y <= metres * metres:
            turn = poses[n, 2] - pose[2] + np.pi
            if turn < 0.0 or turn >= 2 * np.pi:  # a remainder takes ten times as long as all the rest
                turn = turn % (2 * np.pi)
            out[n] = abs(turn - np.pi) <= radians
    return out


def share_within(poses: Array, weights: Array, pose: Array, metres: float, radians: float) -> float:
    """The weight of the particles (N, 3) within a distance and a turn of a pose (3,), of weights (N,)."""
    return float(np.add.reduce(weights[are_within(np.ascontiguousarray(poses), pose, metres, radians)]))


@compiled(nogil=True)
def _heaviest_cell(poses: Array, weights: Array, cell: float, headings: int) -> tuple[Array, Array, float]:
    # The centre of the cell that is heaviest together with its neighbours, that of the heaviest of these, and its mass.
    # Only cells with a particle are kept, in a table with open addresses that is never more than half full.
    left, low, high = np.inf, np.inf, -np.inf
    for n in range(len(poses)):
        left, low, high = min(left, poses[n, 0]), min(low, poses[n, 1]), max(high, poses[n, 1])
    left, low = np.floor(left / cell) - 1, np.floor(low / cell) - 1
    width = int(np.floor(high / cell) - low) + 2
    size = 16
    while size < 2 * len(poses):
        size *= 2
    slots = np.full(size, -1, np.int32)
    cells, mass = np.empty(len(poses), np.int64), np.zeros(len(poses))
    count, turn = 0, 2 * np.pi / headings
    for n in range(len(poses)):
        column, row = int(np.floor(poses[n, 0] / cell) - left), int(np.floor(poses[n, 1] / cell) - low)
        number = (column * width + row) * headings
        number += int(np.floor(poses[n, 2] / turn)) % headings
        slot = _slot(slots, cells, number)
        if slots[slot] < 0:
            slots[slot], cells[count] = count, number
            count += 1
        mass[slots[slot]] += weights[n]
    best, most, densest = 0, -1.0, 0
    # A mode lighter than 64 others is not the heaviest.
    for candidate in np.argsort(-mass[:count], kind="mergesort")[:64]:
        number, around, heaviest = cells[candidate], 0.0, candidate
        for k in range(NEIGHBOUR_STEPS.shape[1]):
            column, row = number // headings // width, number // headings % width
            cell_beside = (column + NEIGHBOUR_STEPS[0, k]) * width + row + NEIGHBOUR_STEPS[1, k]
            beside = slots[
                _slot(slots, cells, cell_beside * headings + (number % headings + NEIGHBOUR_STEPS[2, k]) % headings)
            ]
            around += mass[beside] if beside >= 0 else 0.0
            heaviest = beside if beside >= 0 and mass[beside] > mass[heaviest] else heaviest
        if around > most:
            best, most, densest = number, around, heaviest
    centres = np.empty((2, 3))
    for n, number in enumerate((best, cells[densest])):
        heading = (number % headings + 0.5) * turn
        centres[n, 0] = (number // headings // width + left + 0.5) * cell
        centres[n, 1] = (number // headings % width + low + 0.5) * cell
        centres[n, 2] = heading - 2 * np.pi * (heading > np.pi)
    return centres[0], centres[1], mass[densest]


@compiled(nogil=True)
def _slot(slots: Shorts, cells: Ints, number: int) -> int:
    last = len(slots) - 1  # a power of two, less one
    at = (number * 40503) & last
    while slots[at] >= 0 and cells[slots[at]] != number:
        at = (at + 1) & last
    return at


@compiled(nogil=True)
def _climb(
    poses: Array, weights: Array, sines: Array, cosines: Array, centre: Array, radius: float, angle: float
) -> Bools:
    # Mean shift with a flat kernel; the particles it ends with, or all of them where it finds none.
    members = np.zeros(len(poses), np.bool_)
    least = np.cos(angle)
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
    """Number of equal particles with as much information as these weights: (sum w)^2 / sum w^2."""
    return float(np.add.reduce(weights) ** 2 / np.add.reduce(np.square(weights)))


def systematic(weights: Array, number: int, offset: float) -> Ints:
    """Indices of `number` particles drawn by weight with one comb of equal teeth: (number,), ascending.

    `offset` in [0, 1) places the comb. Particle i is drawn floor or ceil of number w_i times; unbiased for a uniform
    offset.
    """
    drawn = np.empty(number, np.int64)
    _comb(weights, offset, drawn)
    return drawn


@compiled(nogil=True)
def _comb(weights: Array, offset: float, out: Ints) -> None:
    number = len(out)
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


def occupied_cells(poses: Array, cell: float, angle: float) -> int:
    """Number of cells (`cell` metres square by about `angle` radians) that hold a pose."""
    headings = max(1, round(2 * np.pi / angle))
    x, y = np.floor(poses[:, 0] / cell).astype(np.int64), np.floor(poses[:, 1] / cell).astype(np.int64)
    z = np.floor(np.mod(poses[:, 2], 2 * np.pi) * (headings / (2 * np.pi))).astype(np.int64) % headings
    x, y = x - x.min(), y - y.min()
    return len(np.unique((x * (int(y.max()) + 1) + y) * headings + z))


def uniform_around(centres: Array, radius: float, number: int, rng: np.random.Generator) -> Array:
    """Poses (number, 3) uniform over the area within `radius` metres of any centre (R, >= 2), any heading."""
    reach = radius + radius / 2 * np.sqrt(0.5)
    cells = sort_into_cells(centres, reach)
    low, high = centres[:, :2].min(axis=0) - radius, centres[:, :2].max(axis=0) + radius
    cell = radius / 2
    columns, rows = (int(n) for n in np.ceil((high - low) / cell))
    at = distinct(np.floor((centres[:, :2] - low) / cell).astype(np.int64) @ np.array([rows, 1]))
    steps = np.arange(-math.ceil(reach / cell), math.ceil(reach / cell) + 1)
    wide = np.column_stack(np.divmod(at, rows))[:, 1:] + steps  # cells around centres, and no others: maps may be large
    at = distinct((at[:, None] + steps)[(wide >= 0) & (wide < rows)])
    at = distinct(at[:, None] + steps * rows)
    at = at[(at >= 0) & (at < columns * rows)]
    corners = low + cell * np.column_stack(np.divmod(at, rows))
    corners = corners[have_a_point_within(cells, corners + cell / 2, reach)]
    xy = np.empty((0, 2))
    while len(xy) < number:
        drawn = corners[rng.integers(len(corners), size=number)] + cell * rng.random((number, 2))
        xy = np.concatenate([xy, drawn[have_a_point_within(cells, drawn, radius)]])
    return np.column_stack([xy[:number], rng.uniform(-np.pi, np.pi, number)])

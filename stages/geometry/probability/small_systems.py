"""Small systems of equations, vectors and rotations of three dimensions, inside compiled loops."""

import math

import numpy as np

from omninav.pipeline.engine.compiled import compiled
from omninav.stages.geometry.arrays import Array


@compiled(nogil=True)
def solve(matrix: Array, right: Array) -> Array:
    """x of A x = b for a symmetric, positive definite A (n, n) and b (n,), by A = L L'; zeros where A is not definite.

    LAPACK's solver, as numba calls it, would keep the calling functions out of numba's cache.
    """
    size, lower, x = len(right), np.zeros_like(matrix), right.copy()
    for i in range(size):
        for j in range(i + 1):
            rest = matrix[i, j]
            for k in range(j):
                rest -= lower[i, k] * lower[j, k]
            if i != j:
                lower[i, j] = rest / lower[j, j]
            elif rest > 0.0:
                lower[i, i] = math.sqrt(rest)
            else:
                return np.zeros(size)
        for k in range(i):
            x[i] -= lower[i, k] * x[k]
        x[i] /= lower[i, i]
    for i in range(size - 1, -1, -1):
        for k in range(i + 1, size):
            x[i] -= lower[k, i] * x[k]
        x[i] /= lower[i, i]
    return x


@compiled(nogil=True)
def unit(vector: Array) -> Array:
    """A vector (3,) at length 1."""
    return vector / math.sqrt(vector[0] ** 2 + vector[1] ** 2 + vector[2] ** 2)


@compiled(nogil=True)
def rotated_by(rotation: Array, x: float, y: float, z: float) -> Array:
    """A rotation (3, 3) turned further by a rotation vector (rad) given in the frame that it leads to."""
    angle = math.sqrt(x * x + y * y + z * z)
    if angle < 1e-300:
        return rotation.copy()
    x, y, z, cos, sin = x / angle, y / angle, z / angle, math.cos(angle), math.sin(angle)
    rest = 1.0 - cos
    turn, out = np.empty((3, 3)), np.empty((3, 3))
    turn[0, 0], turn[0, 1], turn[0, 2] = cos + x * x * rest, x * y * rest - z * sin, x * z * rest + y * sin
    turn[1, 0], turn[1, 1], turn[1, 2] = y * x * rest + z * sin, cos + y * y * rest, y * z * rest - x * sin
    turn[2, 0], turn[2, 1], turn[2, 2] = z * x * rest - y * sin, z * y * rest + x * sin, cos + z * z * rest
    for i in range(3):
        for j in range(3):
            out[i, j] = turn[i, 0] * rotation[0, j] + turn[i, 1] * rotation[1, j] + turn[i, 2] * rotation[2, j]
    return out

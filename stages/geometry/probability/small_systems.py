"""Linear algebra of a few dimensions inside compiled loops, where calls of LAPACK cost more than the work."""

import math

import numba
import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
Complexes = npt.NDArray[np.complex128]


@numba.njit(cache=True, nogil=True)
def solve(matrix: Array, right: Array) -> Array:
    """x of A x = b for A (n, n), b (n,), by elimination with pivots; zeros where A is singular."""
    size = len(right)
    a, x = matrix.copy(), right.copy()
    for column in range(size):
        pivot = column
        for row in range(column + 1, size):
            if abs(a[row, column]) > abs(a[pivot, column]):
                pivot = row
        if a[pivot, column] == 0.0:
            return np.zeros(size)
        for k in range(size):
            a[column, k], a[pivot, k] = a[pivot, k], a[column, k]
        x[column], x[pivot] = x[pivot], x[column]
        for row in range(column + 1, size):
            factor = a[row, column] / a[column, column]
            for k in range(column, size):
                a[row, k] -= factor * a[column, k]
            x[row] -= factor * x[column]
    for row in range(size - 1, -1, -1):
        for k in range(row + 1, size):
            x[row] -= a[row, k] * x[k]
        x[row] /= a[row, row]
    return x


@numba.njit(cache=True, nogil=True)
def dot(one: Array, two: Array) -> float:
    """The product of two vectors (3,)."""
    return float(one[0] * two[0] + one[1] * two[1] + one[2] * two[2])


@numba.njit(cache=True, nogil=True)
def cross(one: Array, two: Array) -> Array:
    """The vector product of two vectors (3,)."""
    out = np.empty(3)
    out[0] = one[1] * two[2] - one[2] * two[1]
    out[1] = one[2] * two[0] - one[0] * two[2]
    out[2] = one[0] * two[1] - one[1] * two[0]
    return out


@numba.njit(cache=True, nogil=True)
def unit(vector: Array) -> Array:
    """A vector (3,) at length 1."""
    length = math.sqrt(dot(vector, vector))
    out = np.empty(3)
    for i in range(3):
        out[i] = vector[i] / length
    return out


@numba.njit(cache=True, nogil=True)
def applied(matrix: Array, vector: Array) -> Array:
    """A matrix (3, 3) times a vector (3,)."""
    out = np.empty(3)
    for i in range(3):
        out[i] = matrix[i, 0] * vector[0] + matrix[i, 1] * vector[1] + matrix[i, 2] * vector[2]
    return out


@numba.njit(cache=True, nogil=True)
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


@numba.njit(cache=True, nogil=True)
def quartic_roots(coefficients: Array) -> Complexes:
    """The four roots of c0 x^4 + c1 x^3 + … + c4, all at once (Weierstrass, Durand and Kerner).

    Where the first coefficient is the smaller one, those of the reversed polynomial are found and inverted; a root at
    infinity is then a division by 0: not finite.
    """
    reverse = abs(coefficients[0]) < abs(coefficients[4])
    lead = coefficients[4] if reverse else coefficients[0]
    roots, scaled = np.full(4, np.nan + 0j), np.empty(5)
    if lead == 0.0:
        return roots
    size = 0.0
    for k in range(5):
        scaled[k] = (coefficients[4 - k] if reverse else coefficients[k]) / lead
        if k:
            size = max(size, abs(scaled[k]) ** (1.0 / k))
    root = complex(0.4, 0.9) * max(size, 1e-300)
    for k in range(4):
        roots[k] = root
        root = root * complex(0.4, 0.9)
    for _ in range(100):
        change = 0.0
        for k in range(4):
            value = (((roots[k] + scaled[1]) * roots[k] + scaled[2]) * roots[k] + scaled[3]) * roots[k] + scaled[4]
            for j in range(4):
                if j != k:
                    gap = roots[k] - roots[j]
                    value /= gap if gap != 0.0 else complex(1e-300, 0.0)
            roots[k] -= value
            change = max(change, abs(value))
        if change < 1e-13 * size:
            break
    if reverse:
        for k in range(4):
            roots[k] = 1.0 / roots[k] if roots[k] != 0.0 else complex(np.inf, 0.0)
    return roots

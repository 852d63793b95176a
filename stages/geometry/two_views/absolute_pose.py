"""Where a camera is, from bearings of points whose places are known: three at a time, then all that agree.

Convention as in `epipolar`: X = R Xc + t takes the camera's coordinates to those of the points' frame, so `rotation`
(3, 3) and `translation` (3,) are the camera seen from there. Goedemé et al. 2007, section 7.2.3: Grunert's method in
samples of three (erratum 38), the largest agreement, refined locally. Bearings may look anywhere on the sphere.
"""

import math

import numba
import numpy as np
import numpy.typing as npt

from omninav.stages.geometry.probability.small_systems import (
    applied,
    cross,
    dot,
    quartic_roots,
    rotated_by,
    solve,
    unit,
)

from .ransac import AT_ONCE, AgreedPose, samples_needed, samples_of

Array = npt.NDArray[np.float64]
Bools = npt.NDArray[np.bool_]
Ints = npt.NDArray[np.int64]


def grunert(bearings: npt.ArrayLike, points: npt.ArrayLike) -> tuple[Array, Array]:
    """All poses from which three points (3, 3) are seen along three unit bearings (3, 3): up to four.

    Rotations (K, 3, 3) and translations (K, 3). A quartic in v = s3/s1, s the distances to the points (erratum 38;
    where cos gamma = v cos alpha, u = s2/s1 comes from c alone); each solution is polished by Newton's method. None
    where two points coincide.
    """
    rotations, translations = np.empty((8, 3, 3)), np.empty((8, 3))
    number = _grunert(
        np.ascontiguousarray(bearings, np.float64), np.ascontiguousarray(points, np.float64), rotations, translations
    )
    return rotations[:number], translations[:number]


@numba.njit(cache=True, nogil=True)
def _grunert(bearings: Array, points: Array, rotations: Array, translations: Array) -> int:
    side, other, base = points[2] - points[1], points[2] - points[0], points[1] - points[0]
    a2, b2, c2 = dot(side, side), dot(other, other), dot(base, base)
    if min(a2, b2, c2) <= 1e-18 * max(a2, b2, c2) or max(a2, b2, c2) == 0.0:
        return 0
    al, be, ga = (
        dot(bearings[1], bearings[2]),
        dot(bearings[0], bearings[2]),
        dot(bearings[0], bearings[1]),
    )
    p, q = (a2 - c2) / b2, (a2 + c2) / b2
    quartic = np.array(
        [
            (p - 1.0) ** 2 - 4.0 * c2 / b2 * al * al,
            4.0 * (p * (1.0 - p) * be - (1.0 - q) * al * ga + 2.0 * c2 / b2 * al * al * be),
            2.0
            * (
                p * p
                - 1.0
                + 2.0 * p * p * be * be
                + 2.0 * (b2 - c2) / b2 * al * al
                - 4.0 * q * al * be * ga
                + 2.0 * (b2 - a2) / b2 * ga * ga
            ),
            4.0 * (-p * (1.0 + p) * be + 2.0 * a2 / b2 * ga * ga * be - (1.0 - q) * al * ga),
            (1.0 + p) ** 2 - 4.0 * a2 / b2 * ga * ga,
        ]
    )
    if not np.isfinite(quartic).all():
        return 0
    scale, number = math.sqrt(max(a2, b2, c2)), 0
    distances = np.empty((8, 3))
    for root in quartic_roots(quartic):
        # Close to a double root noise makes both complex; what Newton makes of such a root is tested below.
        if not abs(root.imag) <= 1e-3 * (1.0 + abs(root.real)) or root.real <= 0.0:
            continue
        v = root.real
        first = math.sqrt(b2 / max(1.0 + v * v - 2.0 * v * be, 1e-300))
        below = 2.0 * (ga - v * al)
        inside = math.sqrt(max(0.0, ga * ga - 1.0 + c2 / (first * first)))
        for way in range(3):
            # u by the quartic's own formula, else both ways in which c allows it.
            if way == 0:
                if abs(below) < 1e-6:
                    continue
                u = ((p - 1.0) * v * v - 2.0 * p * be * v + 1.0 + p) / below
            elif abs(below) < 1e-6:
                u = ga + inside if way == 1 else ga - inside
            else:
                break
            if u <= 0.0:
                continue
            s = np.array([first, u * first, v * first])
            if _polished(s, a2, b2, c2, al, be, ga) and s.min() > 1e-9 * scale:
                known = False
                for k in range(number):
                    known = known or np.abs(distances[k] - s).max() < 1e-7 * scale
                if not known and number < 8:
                    distances[number] = s
                    _placed(bearings, points, s, rotations[number], translations[number])
                    number += 1
    return number


@numba.njit(cache=True, nogil=True)
def _polished(s: Array, a2: float, b2: float, c2: float, al: float, be: float, ga: float) -> bool:
    # Newton's method on the three laws of cosines; whether they hold in the end.
    jacobian, rest, scale = np.zeros((3, 3)), np.empty(3), max(a2, b2, c2)
    for _ in range(12):
        rest[0] = s[1] * s[1] + s[2] * s[2] - 2.0 * s[1] * s[2] * al - a2
        rest[1] = s[0] * s[0] + s[2] * s[2] - 2.0 * s[0] * s[2] * be - b2
        rest[2] = s[0] * s[0] + s[1] * s[1] - 2.0 * s[0] * s[1] * ga - c2
        if np.abs(rest).max() < 1e-14 * scale:
            return True
        jacobian[0, 1], jacobian[0, 2] = 2.0 * (s[1] - s[2] * al), 2.0 * (s[2] - s[1] * al)
        jacobian[1, 0], jacobian[1, 2] = 2.0 * (s[0] - s[2] * be), 2.0 * (s[2] - s[0] * be)
        jacobian[2, 0], jacobian[2, 1] = 2.0 * (s[0] - s[1] * ga), 2.0 * (s[1] - s[0] * ga)
        s -= solve(jacobian, rest)
    return bool(np.abs(rest).max() < 1e-9 * scale)


@numba.njit(cache=True, nogil=True)
def _placed(bearings: Array, points: Array, s: Array, rotation: Array, translation: Array) -> None:
    # The pose that lays the three points in the camera's frame onto the same in the world's.
    first, second, third = s[0] * bearings[0], s[1] * bearings[1], s[2] * bearings[2]
    here, there = _triad(second - first, third - first), _triad(points[1] - points[0], points[2] - points[0])
    for i in range(3):
        for j in range(3):
            rotation[i, j] = there[0, i] * here[0, j] + there[1, i] * here[1, j] + there[2, i] * here[2, j]
    translation[:] = points[0] - applied(rotation, first)


@numba.njit(cache=True, nogil=True)
def _triad(one: Array, two: Array) -> Array:
    # An orthonormal frame, as rows, of two directions; of the first alone where they are parallel.
    x, z = unit(one), cross(unit(one), two)
    if dot(z, z) < 1e-24 * dot(two, two):
        z = cross(x, np.array([0.0, 0.0, 1.0]) if abs(x[2]) < 0.9 else np.array([1.0, 0.0, 0.0]))
    z = unit(z)
    frame = np.empty((3, 3))
    frame[0], frame[1], frame[2] = x, cross(z, x), z
    return frame


def three_point_pose(
    bearings: npt.ArrayLike,
    points: npt.ArrayLike,
    rng: np.random.Generator,
    threshold: float = math.radians(0.5),
    confidence: float = 0.9999,
    most: int = 2000,
    refine: bool = True,
    planar: bool = False,
) -> AgreedPose | None:
    """Where the camera is that sees most of the points (N, 3) along its unit bearings (N, 3), within `threshold` (rad).

    Samples of three are drawn until one without a wrong point is among them with `confidence`, but at most `most`.
    `refine`: the best is brought to its local optimum, where it is `planar` over x, y and the turn about the vertical
    alone: its height and tilt are those of the points' frame then. None for fewer than three points, or if no sample
    has a solution. Draws from `rng`.
    """
    bearings, points = np.ascontiguousarray(bearings, np.float64), np.ascontiguousarray(points, np.float64)
    number = len(bearings)
    if number < 3:
        return None
    found, least, best, drawn, wanted = None, math.inf, (0, -math.inf), 0, float(most)
    while drawn < min(wanted, most):
        samples = samples_of(number, 3, rng)
        drawn += AT_ONCE
        count, cost, rotation, translation = _search(bearings, points, samples, math.cos(threshold), planar)
        if count == 0 or (count, -cost) <= best:
            continue
        best, pose = (count, -cost), (rotation, translation)
        if refine:
            pose = refined_camera(*pose, bearings, points, threshold, planar)
        # A sample that more agree with need not be the better one once both are refined.
        cost = _tukey(*pose, bearings, points, 1.0 - math.cos(threshold))
        if cost < least:
            found, least = pose, cost
            count = max(count, int(np.count_nonzero(sees(*found, bearings, points, threshold))))
            wanted = samples_needed(count / number, 3, confidence)
    if found is None:
        return None
    return AgreedPose(*found, sees(*found, bearings, points, threshold), drawn)


def sees(
    rotation: Array, translation: Array, bearings: npt.ArrayLike, points: npt.ArrayLike, threshold: float
) -> Bools:
    """Which points (N, 3) a camera sees within `threshold` (rad) of the unit bearings (N, 3): (N,)."""
    rays = (np.asarray(points, dtype=np.float64) - translation) @ rotation
    length = np.linalg.norm(rays, axis=1)
    cos = np.einsum("ij,ij->i", rays, np.asarray(bearings, dtype=np.float64))
    return np.asarray((cos > math.cos(threshold) * length) & (length > 0.0))


@numba.njit(cache=True, nogil=True)
def _miss(R: Array, t: Array, bearing: Array, point: Array) -> float:
    # 1 - cosine between where a point is and where it is seen: half the squared angle.
    x, y, z = point[0] - t[0], point[1] - t[1], point[2] - t[2]
    length = math.sqrt(x * x + y * y + z * z)
    if length == 0.0:
        return 2.0
    cos = (
        (R[0, 0] * x + R[1, 0] * y + R[2, 0] * z) * bearing[0]
        + (R[0, 1] * x + R[1, 1] * y + R[2, 1] * z) * bearing[1]
        + (R[0, 2] * x + R[1, 2] * y + R[2, 2] * z) * bearing[2]
    )
    return float(1.0 - cos / length)


@numba.njit(cache=True, nogil=True)
def _upright(R: Array, t: Array) -> None:
    # The turn about the vertical that is closest to R, at the height of the points' frame.
    yaw = math.atan2(R[1, 0] - R[0, 1], R[0, 0] + R[1, 1])
    R[:] = 0.0
    R[0, 0], R[0, 1], R[1, 0], R[1, 1], R[2, 2] = math.cos(yaw), -math.sin(yaw), math.sin(yaw), math.cos(yaw), 1.0
    t[2] = 0.0


@numba.njit(cache=True, nogil=True)
def _search(
    bearings: Array, points: Array, samples: Ints, cos_limit: float, planar: bool
) -> tuple[int, float, Array, Array]:
    limit, best, least = 1.0 - cos_limit, 0, np.inf
    rotations, translations = np.empty((8, 3, 3)), np.empty((8, 3))
    rotation, translation = np.eye(3), np.zeros(3)
    for s in range(len(samples)):
        for k in range(_grunert(bearings[samples[s]], points[samples[s]], rotations, translations)):
            R, t = rotations[k].copy(), translations[k].copy()
            if planar:
                _upright(R, t)
            count, cost = 0, 0.0
            for n in range(len(bearings)):
                miss = _miss(R, t, bearings[n], points[n])
                count += miss < limit
                cost += min(miss, limit)
            if count > best or (count == best and cost < least):
                best, least, rotation, translation = count, cost, R, t
    return best, least, rotation, translation


def refined_camera(
    rotation: Array,
    translation: Array,
    bearings: npt.ArrayLike,
    points: npt.ArrayLike,
    threshold: float,
    planar: bool = False,
    steps: int = 10,
) -> tuple[Array, Array]:
    """The camera's pose at the local optimum of the angles to its points, with Tukey's weights up to `threshold` (rad).

    `planar`: only x, y and the turn about the vertical move.
    """
    bearings, points = np.ascontiguousarray(bearings, np.float64), np.ascontiguousarray(points, np.float64)
    refined: tuple[Array, Array] = _refine(
        np.ascontiguousarray(rotation), translation.copy(), bearings, points, math.cos(threshold), planar, steps
    )
    return refined


@numba.njit(cache=True, nogil=True)
def _tukey(R: Array, t: Array, bearings: Array, points: Array, limit: float) -> float:
    cost = 0.0
    for n in range(len(bearings)):
        miss = _miss(R, t, bearings[n], points[n])
        cost += 1.0 - (1.0 - miss / limit) ** 3 if miss < limit else 1.0
    return cost


@numba.njit(cache=True, nogil=True)
def _refine(
    R: Array, t: Array, bearings: Array, points: Array, cos_limit: float, planar: bool, steps: int
) -> tuple[Array, Array]:
    # Levenberg and Marquardt. Freedoms: x, y, turn about the vertical; then z and both other turns.
    freedoms, limit, damping = 3 if planar else 6, 1.0 - cos_limit, 1e-3
    cost, row = _tukey(R, t, bearings, points, limit), np.empty((3, 6))
    for _ in range(steps):
        square, slope = np.zeros((freedoms, freedoms)), np.zeros(freedoms)
        for n in range(len(bearings)):
            miss = _miss(R, t, bearings[n], points[n])
            if miss >= limit:
                continue
            seen, ray = applied(R, bearings[n]), points[n] - t
            length = math.sqrt(dot(ray, ray))
            ray = ray / length
            # residual: ray - seen, both in the points' frame; the ray moves with t, the bearing with R
            row[:] = 0.0
            for i in range(3):
                for k in range(3):
                    slot = k if k < 2 else 3
                    row[i, slot] = (ray[i] * ray[k] - (1.0 if i == k else 0.0)) / length
            row[0, 2], row[1, 2] = seen[1], -seen[0]
            row[1, 4], row[2, 4] = seen[2], -seen[1]
            row[0, 5], row[2, 5] = -seen[2], seen[0]
            weight = (1.0 - miss / limit) ** 2
            for k in range(freedoms):
                for i in range(3):
                    slope[k] += weight * row[i, k] * (ray[i] - seen[i])
                    for j in range(freedoms):
                        square[k, j] += weight * row[i, k] * row[i, j]
        better = False
        while damping < 1e6:
            damped = square.copy()
            for k in range(freedoms):
                damped[k, k] += damping * square[k, k] + 1e-15
            step = -solve(damped, slope)
            if planar:
                new_t = np.array([t[0] + step[0], t[1] + step[1], t[2]])
                new_R = rotated_by(R, 0.0, 0.0, step[2])
            else:
                new_t = np.array([t[0] + step[0], t[1] + step[1], t[2] + step[3]])
                new_R = rotated_by(R, step[4], step[5], step[2])
            new_cost = _tukey(new_R, new_t, bearings, points, limit)
            if new_cost < cost:
                better = cost - new_cost > 1e-9 * cost
                R, t, cost, damping = new_R, new_t, new_cost, max(0.1 * damping, 1e-9)
                break
            damping *= 10.0
        if not better:
            break
    return R, t

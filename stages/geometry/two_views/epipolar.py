"""Two views of the same points as unit bearings: essential matrices of eight, five or two of them, and their poses.

Convention, everywhere: `rotation` R (3, 3) and `translation` t (3,) are camera 2 seen from camera 1, X1 = R X2 + t. So
t points from where view 1 was taken to where view 2 was, and R turns bearings of view 2 into the frame of view 1. The
essential matrix is E = [t]x R, with b1' E b2 = 0. Its scale is lost: translations have length 1. In homing view 1 is
what is seen now and view 2 the target: t is where to go, the yaw of R how far to turn there (erratum 39 in
docs/papers.md).

Goedemé et al. 2007, section 7.1.1, with errata 34 to 37. Bearings may look anywhere on the sphere; nothing here asks
for a positive z.
"""

import math

import numpy as np
import numpy.typing as npt
import poselib

from omninav.pipeline.engine.compiled import compiled
from omninav.stages.geometry.arrays import Array, Ints

from .triangulation import depths

Poses = tuple[Array, Array]
"""Rotations (K, 3, 3) and translations (K, 3)."""


def essential(rotation: Array, translation: npt.ArrayLike) -> Array:
    """E = [t]x R (3, 3), with [t]x w = t x w."""
    x, y, z = np.asarray(translation, dtype=np.float64)
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]]) @ rotation


def turn_about_vertical(angle: float) -> Array:
    """R (3, 3) of a robot turned by `angle` (rad), counter-clockwise."""
    cos, sin = math.cos(angle), math.sin(angle)
    return np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])


def yaw_of(rotation: Array) -> float:
    """Turn of a rotation (3, 3) about the vertical (rad, counter-clockwise)."""
    return math.atan2(rotation[1, 0] - rotation[0, 1], rotation[0, 0] + rotation[1, 1])


def angular_residuals(matrix: Array, first: npt.ArrayLike, second: npt.ArrayLike) -> Array:
    """Angles (N,), rad, by which bearings of view 1 miss the epipolar planes of those of view 2 (erratum 35).

    asin(|b1.n| / |n|), n = E b2. 0 where a bearing of view 2 looks along the baseline: every plane through it would do.
    """
    first, second = np.asarray(first, dtype=np.float64), np.asarray(second, dtype=np.float64)
    normals = second @ matrix.T
    length = np.linalg.norm(normals, axis=1)
    sine = np.abs(np.einsum("ij,ij->i", first, normals)) / np.where(length > 0.0, length, 1.0)
    return np.asarray(np.arcsin(np.minimum(sine, 1.0)))


def shared_residuals(rotation: Array, translation: Array, first: npt.ArrayLike, second: npt.ArrayLike) -> Array:
    """Angles (N,), rad, by which the bearings of both views together must move to share a plane with the baseline.

    To first order: asin(|b1' E b2| / sqrt(|E b2|^2 + |E' b1|^2)), in which the noise of both views counts equally and a
    bearing close to the baseline, whose plane is hardly known, is not blamed for it.
    """
    first, second = np.asarray(first, dtype=np.float64), np.asarray(second, dtype=np.float64)
    matrix = essential(rotation, translation)
    normals, others = second @ matrix.T, first @ matrix
    length = np.sqrt((normals**2).sum(axis=1) + (others**2).sum(axis=1))
    sine = np.abs(np.einsum("ij,ij->i", first, normals)) / np.where(length > 0.0, length, 1.0)
    return np.asarray(np.arcsin(np.minimum(sine, 1.0)))


def eight_points(first: npt.ArrayLike, second: npt.ArrayLike) -> tuple[Array, Array]:
    """The linear fit of E to eight or more pairs of bearings, many times at once, and its quality q_e.

    `first`, `second`: (..., N, 3), unit length, which is all the scaling it needs (erratum 36). Gives E (..., 3, 3)
    with singular values (1, 1, 0), and q_e = 1 - s2/s1 of the fit before they were made equal: 0 for a true essential
    matrix. Ill-conditioned where most features are on the horizon of a robot on a floor (erratum 37).
    """
    first, second = np.asarray(first, dtype=np.float64), np.asarray(second, dtype=np.float64)
    rows = (first[..., :, None] * second[..., None, :]).reshape(*first.shape[:-1], 9)
    if rows.shape[-2] < 9:  # then the null vector would not be among those that are given back
        rows = np.concatenate([rows, np.zeros((*rows.shape[:-2], 1, 9))], axis=-2)
    fitted = np.linalg.svd(rows, full_matrices=False)[2][..., -1, :].reshape(*first.shape[:-2], 3, 3)
    left, values, right = np.linalg.svd(fitted)
    quality = 1.0 - values[..., 1] / np.maximum(values[..., 0], np.finfo(np.float64).tiny)
    return left[..., :, :2] @ right[..., :2, :], quality


def five_points(first: npt.ArrayLike, second: npt.ArrayLike) -> Poses:
    """All relative poses on which five pairs of unit bearings (5, 3) agree, in front of both cameras: up to ten.

    Poselib's solver (Nistér 2004). It takes the world to its second camera; ours is the other way about.
    """
    found = poselib.relpose_5pt(np.asarray(second, dtype=np.float64), np.asarray(first, dtype=np.float64))
    rotations = np.array([pose.R for pose in found]).reshape(-1, 3, 3)
    return rotations, np.array([pose.t for pose in found]).reshape(-1, 3)


@compiled(nogil=True)
def planar_candidates(first: Array, second: Array, samples: Ints) -> tuple[Array, Array, Ints]:
    """All relative poses of a robot on a floor on which two pairs of unit bearings agree: of each sample two, or none.

    `samples` (S, 2): rows of `first` and `second` (N, 3). Gives rotations (K, 3, 3), translations (K, 3), and from
    which sample each is: (K,). With R a turn by phi about the vertical, t = (cos theta, sin theta, 0) and psi = theta -
    phi, E has four entries (erratum 37) and a pair gives z2 (x1 sin theta - y1 cos theta) = z1 (x2 sin psi - y2 cos
    psi). Two of them are A u = B w for the unit vectors u and w of theta and psi; w is taken out, |B^-1 A u| = |u| is a
    quadratic form in u, and vanishes along up to two lines. Both senses of t fit: the depths decide. None
    where both points are on the horizon, of which a robot on a floor learns nothing, and where noise leaves no real
    solution.
    """
    rotations, translations = np.zeros((2 * len(samples), 3, 3)), np.zeros((2 * len(samples), 3))
    owners, angles, number = np.empty(2 * len(samples), np.int64), np.empty((2, 2)), 0
    for s in range(len(samples)):
        i, j = samples[s]
        for k in range(_planar(first[i], first[j], second[i], second[j], angles)):
            cos, sin = math.cos(angles[k, 1]), math.sin(angles[k, 1])
            rotations[number, 0, 0], rotations[number, 0, 1] = cos, -sin
            rotations[number, 1, 0], rotations[number, 1, 1] = sin, cos
            rotations[number, 2, 2] = 1.0
            translations[number, 0], translations[number, 1] = math.cos(angles[k, 0]), math.sin(angles[k, 0])
            owners[number] = s
            number += 1
    return rotations[:number], translations[:number], owners[:number]


@compiled(nogil=True)
def _planar(b1: Array, c1: Array, b2: Array, c2: Array, out: Array) -> int:
    # b and c: the two points. Rows of `out`: theta, phi. With N = adj(B) A: |N u|^2 = det(B)^2 |u|^2.
    a00, a01 = -b2[2] * b1[1], b2[2] * b1[0]
    a10, a11 = -c2[2] * c1[1], c2[2] * c1[0]
    b00, b01 = -b1[2] * b2[1], b1[2] * b2[0]
    b10, b11 = -c1[2] * c2[1], c1[2] * c2[0]
    det = b00 * b11 - b01 * b10
    n00, n01 = b11 * a00 - b01 * a10, b11 * a01 - b01 * a11
    n10, n11 = b00 * a10 - b10 * a00, b00 * a11 - b10 * a01
    p = n00 * n00 + n10 * n10 - det * det
    q = n00 * n01 + n10 * n11
    r = n01 * n01 + n11 * n11 - det * det
    across = math.hypot(0.5 * (p - r), q)
    if det == 0.0 or across == 0.0 or abs(p + r) > 2.0 * across:
        return 0
    middle, half = math.atan2(q, 0.5 * (p - r)), math.acos(-(p + r) / (2.0 * across))
    for k in range(2):
        theta = 0.5 * (middle + half) if k == 0 else 0.5 * (middle - half)
        cos, sin = math.cos(theta), math.sin(theta)
        out[k, 0] = theta
        out[k, 1] = theta - math.atan2((n10 * cos + n11 * sin) / det, (n00 * cos + n01 * sin) / det)
    return 2


def decompose(matrix: Array) -> Poses:
    """The four relative poses that essential matrices (..., 3, 3) allow: (..., 4, 3, 3), and unit t (..., 4, 3).

    Those with an odd number differ from the one before in the sense of t alone.
    """
    left, _, right = np.linalg.svd(matrix)
    left = left * np.sign(np.linalg.det(left))[..., None, None]
    right = right * np.sign(np.linalg.det(right))[..., None, None]
    quarter = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    one, other, along = left @ quarter @ right, left @ quarter.T @ right, left[..., :, 2]
    return np.stack([one, one, other, other], axis=-3), np.stack([along, -along, along, -along], axis=-2)


def in_front(poses: Poses, first: npt.ArrayLike, second: npt.ArrayLike) -> Ints:
    """For each relative pose how many points are in front of both cameras: (K,).

    In front is a positive depth along both bearings, wherever they look; the sign of z, which is what pinhole code
    tests, is wrong beyond 180 degrees (erratum 36).
    """
    pairs = (depths(first, second, rotation, translation) for rotation, translation in zip(*poses, strict=True))
    return np.array([np.count_nonzero((here > 0.0) & (there > 0.0)) for here, there in pairs], dtype=np.int64)

"""The odometry motion model: rotation, translation, rotation, applied to samples and to Gaussians."""

import math

import numpy as np

from omninav.pipeline.engine.compiled import compiled
from omninav.stages.geometry.arrays import Array

from .se2 import compose, wrap, wrap_angle

Triple = tuple[float, float, float]


def decompose_motion(x: float, y: float, turn: float) -> Triple:
    """A motion as a rotation towards its end, a translation (negative: backwards), and the rest of the rotation.

    A motion backwards stays one, so that the first rotation is within 90 degrees.
    """
    translation = math.hypot(x, y)
    if translation < 1e-9:
        return 0.0, 0.0, turn
    first = math.atan2(y, x)
    if abs(first) > math.pi / 2:
        first, translation = wrap_angle(first + math.pi), -translation
    return first, translation, wrap_angle(turn - first)


@compiled(nogil=True)
def move_poses(poses: Array, motion: Triple, sigmas: Triple, noise: Array) -> Array:
    """Poses (N, 3) after rotation, translation, rotation, with `noise` (3, N) of unit variance scaled by `sigmas`."""
    out = np.empty_like(poses)
    for n in range(len(poses)):
        first = poses[n, 2] + motion[0] + sigmas[0] * noise[0, n]
        translation = motion[1] + sigmas[1] * noise[1, n]
        last = first + motion[2] + sigmas[2] * noise[2, n]
        out[n, 0] = poses[n, 0] + translation * np.cos(first)
        out[n, 1] = poses[n, 1] + translation * np.sin(first)
        out[n, 2] = last - 2 * np.pi * np.floor((last + np.pi) / (2 * np.pi))
    return out


def move_gaussians(means: Array, covariances: Array, motion: Triple, sigmas: Triple) -> tuple[Array, Array]:
    """Gaussians (K, 3), (K, 3, 3) after rotation, translation, rotation with noise of `sigmas`, linearised.

    C' = F C F^T + G diag(sigmas^2) G^T with F, G the derivatives of `move_poses` by the pose and by the noise: positive
    definite where C is.
    """
    headings = means[:, 2] + motion[0]
    cos, sin = np.cos(headings), np.sin(headings)
    by_pose = np.broadcast_to(np.eye(3), covariances.shape).copy()
    by_pose[:, 0, 2], by_pose[:, 1, 2] = -motion[1] * sin, motion[1] * cos
    ends = np.column_stack([means[:, 0] + motion[1] * cos, means[:, 1] + motion[1] * sin, wrap(headings + motion[2])])
    spread = by_pose @ covariances @ np.swapaxes(by_pose, 1, 2) + _noise(headings, motion[1], sigmas)
    return ends, 0.5 * (spread + np.swapaxes(spread, 1, 2))


def motion_gaussian(motion: Triple, sigmas: Triple) -> tuple[Array, Array]:
    """Rotation, translation, rotation as one motion (3,) in the frame of its start, and its covariance (3, 3).

    The rank is 3 where there is a translation and all sigmas are above 0; a turn in place moves nothing sideways.
    """
    end = compose((0.0, 0.0, motion[0]), (motion[1], 0.0, motion[2]))
    return end, _noise(np.array([motion[0]]), motion[1], sigmas)[0]


def _noise(headings: Array, translation: float, sigmas: Triple) -> Array:
    # Covariance of the pose (K, 3, 3) by the noise alone, `headings` (K,) being those of the translation.
    cos, sin = np.cos(headings), np.sin(headings)
    by_noise = np.zeros((len(headings), 3, 3))
    by_noise[:, 0, 0], by_noise[:, 1, 0], by_noise[:, 2, 0] = -translation * sin, translation * cos, 1.0
    by_noise[:, 0, 1], by_noise[:, 1, 1], by_noise[:, 2, 2] = cos, sin, 1.0
    by_noise *= np.asarray(sigmas, np.float64)
    return by_noise @ np.swapaxes(by_noise, 1, 2)

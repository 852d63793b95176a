"""Absolute pose of a camera from bearings of known points: three at a time, then all that agree.

Convention as in `epipolar`: X = R Xc + t takes the camera's coordinates to those of the points' frame, so `rotation`
(3, 3) and `translation` (3,) are the camera seen from there. Goedemé et al. 2007, section 7.2.3: three points in a
sample (poselib's solver in place of Grunert's, erratum 38 in docs/papers.md), the largest agreement, refined locally.
Bearings may look anywhere on the sphere.
"""

import math

import numpy as np
import numpy.typing as npt
import poselib

from omninav.pipeline.engine.compiled import compiled
from omninav.stages.geometry.arrays import Array, Bools, Ints
from omninav.stages.geometry.probability.small_systems import rotated_by

from .ransac import BATCH, AgreedPose, refined, samples_needed, samples_of

CONFIDENCE, MAX_SAMPLES = 0.9999, 2000
"""Probability that a sample without a wrong point is drawn, and the largest number of samples."""


def three_point_pose(
    bearings: npt.ArrayLike,
    points: npt.ArrayLike,
    rng: np.random.Generator,
    threshold: float = math.radians(0.5),
    refine: bool = True,
    planar: bool = False,
) -> AgreedPose | None:
    """Pose of the camera that sees most of the points (N, 3) along its unit bearings (N, 3), within `threshold` (rad).

    Samples of three are drawn until one without a wrong point is among them with `CONFIDENCE`, but at most
    `MAX_SAMPLES`. `refine`: the best is brought to its local optimum. `planar`: its height and tilt are those of the
    points' frame, and only x, y and the turn about the vertical are estimated. None for fewer than three points, or if
    no sample has a solution. Draws from `rng`.
    """
    bearings, points = np.ascontiguousarray(bearings, np.float64), np.ascontiguousarray(points, np.float64)
    number = len(bearings)
    if number < 3:
        return None
    found, least, best, drawn, needed = None, math.inf, (0, -math.inf), 0, float(MAX_SAMPLES)
    limit = 1.0 - math.cos(threshold)
    while drawn < min(needed, MAX_SAMPLES):
        samples = samples_of(number, 3, rng)
        drawn += BATCH
        rotations, translations = _candidates(bearings[samples], points[samples], planar)
        if not len(rotations):
            continue
        counts, costs = _judge(rotations, translations, bearings, points, limit)
        k = int(np.lexsort((costs, -counts))[0])
        if (counts[k], -costs[k]) <= best:
            continue
        best, pose = (int(counts[k]), -float(costs[k])), (rotations[k], translations[k])
        if refine:
            pose = refined_camera(*pose, bearings, points, threshold, planar)
        # The sample with more inliers need not be the better one once both are refined.
        cost = _tukey(*pose, bearings, points, limit)
        if cost < least:
            found, least = pose, cost
            agreeing = int(np.count_nonzero(sees(*found, bearings, points, threshold)))
            needed = samples_needed(max(best[0], agreeing) / number, 3, CONFIDENCE)
    if found is None:
        return None
    return AgreedPose(*found, sees(*found, bearings, points, threshold), drawn)


def _candidates(bearings: Array, points: Array, planar: bool) -> tuple[Array, Array]:
    # All poses of samples (S, 3, 3). Poselib's pose takes the world to the camera, ours the camera to the world.
    solved = [pose for sample in zip(bearings, points, strict=True) for pose in poselib.p3p(*sample)]
    poses = np.array([pose.Rt for pose in solved]).reshape(-1, 3, 4)
    poses = poses[np.isfinite(poses).all(axis=(1, 2))]
    rotations = poses[:, :, :3].transpose(0, 2, 1)
    translations = -np.einsum("kij,kj->ki", rotations, poses[:, :, 3])
    if planar:  # the turn about the vertical that is closest, at the height of the points' frame
        yaws = np.arctan2(rotations[:, 1, 0] - rotations[:, 0, 1], rotations[:, 0, 0] + rotations[:, 1, 1])
        rotations, translations[:, 2] = np.zeros_like(rotations), 0.0
        rotations[:, 0, 0], rotations[:, 1, 1], rotations[:, 2, 2] = np.cos(yaws), np.cos(yaws), 1.0
        rotations[:, 1, 0], rotations[:, 0, 1] = np.sin(yaws), -np.sin(yaws)
    return np.ascontiguousarray(rotations), translations


def sees(
    rotation: Array, translation: Array, bearings: npt.ArrayLike, points: npt.ArrayLike, threshold: float
) -> Bools:
    """Which points (N, 3) a camera sees within `threshold` (rad) of the unit bearings (N, 3): (N,)."""
    rays = (np.asarray(points, dtype=np.float64) - translation) @ rotation
    length = np.linalg.norm(rays, axis=1)
    cos = np.einsum("ij,ij->i", rays, np.asarray(bearings, dtype=np.float64))
    return np.asarray((cos > math.cos(threshold) * length) & (length > 0.0))


@compiled(nogil=True)
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


@compiled(nogil=True)
def _judge(rotations: Array, translations: Array, bearings: Array, points: Array, limit: float) -> tuple[Ints, Array]:
    # For each pose: how many points agree with it, and the sum of truncated misses.
    counts, costs = np.zeros(len(rotations), np.int64), np.zeros(len(rotations))
    for k in range(len(rotations)):
        for n in range(len(bearings)):
            miss = _miss(rotations[k], translations[k], bearings[n], points[n])
            counts[k] += miss < limit
            costs[k] += min(miss, limit)
    return counts, costs


def refined_camera(
    rotation: Array,
    translation: Array,
    bearings: npt.ArrayLike,
    points: npt.ArrayLike,
    threshold: float,
    planar: bool = False,
) -> tuple[Array, Array]:
    """The camera's pose at the local optimum of the angles to its points, with Tukey's weights up to `threshold` (rad).

    `planar`: only x, y and the turn about the vertical move.
    """
    bearings, points = np.ascontiguousarray(bearings, np.float64), np.ascontiguousarray(points, np.float64)
    limit, freedoms = 1.0 - math.cos(threshold), 3 if planar else 6
    pose = np.ascontiguousarray(rotation), translation
    return refined(_tukey, _normal_equations, _moved, pose, bearings, points, limit, freedoms)


@compiled(nogil=True)
def _moved(R: Array, t: Array, step: Array) -> tuple[Array, Array]:
    # Freedoms: x, y, turn about the vertical; then, unless planar, z and both other turns.
    x, y, yaw = step[0], step[1], step[2]
    z, roll, pitch = (step[3], step[4], step[5]) if len(step) == 6 else (0.0, 0.0, 0.0)
    return rotated_by(R, roll, pitch, yaw), t + np.array([x, y, z])


@compiled(nogil=True)
def _tukey(R: Array, t: Array, bearings: Array, points: Array, limit: float) -> float:
    cost = 0.0
    for n in range(len(bearings)):
        miss = _miss(R, t, bearings[n], points[n])
        cost += 1.0 - (1.0 - miss / limit) ** 3 if miss < limit else 1.0
    return cost


@compiled(nogil=True)
def _normal_equations(
    R: Array, t: Array, bearings: Array, points: Array, limit: float, freedoms: int
) -> tuple[Array, Array]:
    # Residual: the ray to the point less the bearing, in the points' frame; the ray moves with t, the bearing with R.
    square, slope, row = np.zeros((6, 6)), np.zeros(6), np.zeros((3, 6))
    seen, ray = np.empty(3), np.empty(3)
    for n in range(len(bearings)):
        miss = _miss(R, t, bearings[n], points[n])
        if miss >= limit:
            continue
        length = 0.0
        for i in range(3):
            seen[i] = R[i, 0] * bearings[n, 0] + R[i, 1] * bearings[n, 1] + R[i, 2] * bearings[n, 2]
            ray[i] = points[n, i] - t[i]
            length += ray[i] * ray[i]
        length = math.sqrt(length)
        ray /= length
        for i in range(3):
            for k in range(3):
                row[i, k if k < 2 else 3] = (ray[i] * ray[k] - (1.0 if i == k else 0.0)) / length
        row[0, 2], row[1, 2] = seen[1], -seen[0]
        row[1, 4], row[2, 4] = seen[2], -seen[1]
        row[0, 5], row[2, 5] = -seen[2], seen[0]
        weight = (1.0 - miss / limit) ** 2
        for k in range(6):
            for i in range(3):
                slope[k] += weight * row[i, k] * (ray[i] - seen[i])
                for j in range(6):
                    square[k, j] += weight * row[i, k] * row[i, j]
    return np.ascontiguousarray(square[:freedoms, :freedoms]), slope[:freedoms]

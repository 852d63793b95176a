"""The pose of a robot on a floor from the bearings of known points, some of them wrong."""

import math
from typing import Any, NamedTuple

import numpy as np
import poselib

from omninav.pipeline.engine.compiled import compiled
from omninav.stages.geometry.appearance.feature_matching import NOWHERE, Pairs, mutual_nearest_units
from omninav.stages.geometry.arrays import Array, Bools, Floats
from omninav.stages.geometry.plane.se2 import wrap_angle
from omninav.stages.geometry.probability.small_systems import rotated_by, solve
from omninav.stages.geometry.two_views.absolute_pose import sees

FACES = 6
"""Virtual pinhole cameras that share the circle: poselib's solver takes pixels, and a pinhole no full circle."""
FOCAL_PX = 1000.0
"""Their focal length: a pixel is about a milliradian."""
SAMPLES = (30, 1000)
"""Samples that are drawn at least and at most."""
MAX_FAILURE = 1e-3
"""Probability with which a pose of just enough inliers may be missed."""
HEIGHT_SIGMA_M, TILT_SIGMA = 0.02, math.radians(3.0)
"""Standard deviations of the camera's height against the map's, and of the robot's tilt (rad): floors are not flat, and
robots brake."""
MAX_TILT = math.radians(30.0)
"""Tilt above which a pose is none of a robot on a floor (rad): the mirror image of a wall is seen from upside down."""
START_DECIMALS = 4
"""Decimals of the refinement's start, m and of a quaternion."""
RATIO = 0.85
"""Largest ratio of a match's distance to that of the second nearest landmark."""
TOLERANCE = math.radians(0.6)
"""Angle to its landmark within which a bearing agrees with a pose (rad)."""
ELSEWHERE = (0.5, math.radians(10.0))
"""Distance (m) and turn (rad) from the best pose beyond which another one is a rival."""
MAX_POSES = 2
"""Poses that an image may have: the best one, and its rival."""
RIVAL_SHARE = 0.5
"""Share of the best pose's inliers that a rival must have: none with fewer is looked for."""
STEPS = 10
"""Gauss-Newton steps of the refinement."""


class BearingPose(NamedTuple):
    """A pose with its uncertainty. `pose` (3,): x, y (m), heading (rad). `covariance` (3, 3), per unit of variance of a
    bearing (rad^2). `sigma`: standard deviation of its inliers' bearings (rad). `inliers` (M,): which points agree.
    `tilt`: of the robot (rad)."""

    pose: Array
    covariance: Array
    sigma: float
    inliers: Bools
    tilt: float


def pose_of_bearings(
    bearings: Array, points: Array, tolerance: float, sigma: float, min_inliers: int = 4
) -> BearingPose | None:
    """The pose from which most points (M, 3) are seen along their unit bearings (M, 3), within `tolerance` (rad).

    A sample consensus of poselib's generalised solver in six degrees of freedom, then a robust least squares in which
    height and tilt stay near those of a floor; `sigma` (rad): standard deviation of a bearing. None where no sample of
    three has a solution.
    """
    min_inliers = max(min_inliers, 4)
    if len(bearings) < min_inliers:
        return None
    rotation, translation, agreeing = _ransac(bearings, points, tolerance, _samples(min_inliers / len(bearings)))
    if agreeing.sum() < 4:
        return None
    R, t, square, spread = _refined(rotation, translation, bearings[agreeing], points[agreeing], sigma)
    tilt = math.acos(min(1.0, max(-1.0, float(R[2, 2]))))
    if not tilt <= MAX_TILT:
        return None
    pose = np.array([t[0], t[1], math.atan2(R[1, 0], R[0, 0])])
    covariance: Array = np.linalg.inv(square)[:3, :3].astype(np.float64)
    inliers = sees(R, t, bearings, points, tolerance)
    if inliers.sum() < min_inliers:
        return None
    return BearingPose(pose, covariance, spread, inliers, tilt)


def matched(descriptors: Floats, landmarks: Floats, points: Array = NOWHERE) -> Pairs:
    """Pairs of features and landmarks, by their descriptors (N, D) and (L, D) of length 1; `points` (L, 3)."""
    return mutual_nearest_units(descriptors, landmarks, RATIO, points)


def poses_of(bearings: Array, points: Array, sigma: float, min_inliers: int) -> list[BearingPose]:
    """The poses that most bearings (M, 3) agree on, and a rival elsewhere that those left over agree on."""
    found: list[BearingPose] = []
    left = np.ones(len(points), np.bool_)
    for _ in range(MAX_POSES):
        rows = np.flatnonzero(left)
        pose = pose_of_bearings(bearings[rows], points[rows], TOLERANCE, sigma, min_inliers)
        if pose is None or (found and not _is_elsewhere(pose, found[0])):
            break
        inliers = np.zeros(len(points), np.bool_)
        inliers[rows] = pose.inliers
        found.append(pose._replace(inliers=inliers))
        left &= ~inliers
        min_inliers = max(min_inliers, math.ceil(RIVAL_SHARE * inliers.sum()))
    return found


def _is_elsewhere(pose: BearingPose, other: BearingPose) -> bool:
    away = pose.pose - other.pose
    return math.hypot(away[0], away[1]) > ELSEWHERE[0] or abs(wrap_angle(float(away[2]))) > ELSEWHERE[1]


def _faces() -> tuple[Array, list[Any]]:
    azimuths = np.arange(FACES) * (2.0 * math.pi / FACES)
    forward = np.column_stack([np.cos(azimuths), np.sin(azimuths), np.zeros(FACES)])
    right = np.column_stack([np.sin(azimuths), -np.cos(azimuths), np.zeros(FACES)])
    down = np.tile([0.0, 0.0, -1.0], (FACES, 1))
    axes = np.stack([right, down, forward], axis=1)
    cameras = []
    for rows in axes:
        camera = poselib.CameraPose()
        camera.R, camera.t = rows, np.zeros(3)
        cameras.append(camera)
    return axes, cameras


AXES, CAMERAS = _faces()
PINHOLES = [{"model": "SIMPLE_PINHOLE", "width": 1, "height": 1, "params": [FOCAL_PX, 0.0, 0.0]}] * FACES


def _samples(share: float) -> int:
    """Samples of three after which one is of inliers alone, where they are this share of all points."""
    right = min(share**3, 1.0 - 1e-9)
    return min(SAMPLES[1], max(SAMPLES[0], math.ceil(math.log(MAX_FAILURE) / math.log1p(-right))))


def _ransac(bearings: Array, points: Array, tolerance: float, samples: int) -> tuple[Array, Array, Bools]:
    azimuths = np.arctan2(bearings[:, 1], bearings[:, 0])
    face = np.rint(azimuths * (FACES / (2.0 * math.pi))).astype(np.int64) % FACES
    rows = [np.flatnonzero(face == f) for f in range(FACES)]
    seen = [bearings[r] @ axes.T for r, axes in zip(rows, AXES, strict=True)]
    pixels = [FOCAL_PX * each[:, :2] / np.maximum(each[:, 2:], 1e-6) for each in seen]
    options = {
        "max_reproj_error": FOCAL_PX * math.tan(tolerance),
        "max_iterations": samples,
        "min_iterations": SAMPLES[0],
    }
    found, report = poselib.estimate_generalized_absolute_pose(
        pixels, [points[r] for r in rows], CAMERAS, PINHOLES, options, {"max_iterations": 0}
    )
    agreeing = np.zeros(len(bearings), np.bool_)
    for r, inliers in zip(rows, report["inliers"], strict=True):
        agreeing[r] = inliers
    # The solver's last bits differ from call to call: rounded, the same image has the same pose to the last bit.
    centre = np.round(-found.R.T @ found.t, START_DECIMALS)
    found.q = np.round(found.q, START_DECIMALS) / np.linalg.norm(np.round(found.q, START_DECIMALS))
    return np.ascontiguousarray(found.R.T), centre, agreeing


@compiled(nogil=True)
def _refined(R: Array, t: Array, bearings: Array, points: Array, sigma: float) -> tuple[Array, Array, Array, float]:
    # Freedoms: x, y, turn about the vertical, z, roll, pitch. Residuals: the ray to the point less the bearing, in the
    # map frame, with Cauchy's weights; and height and tilt against those of a floor.
    square, row, seen, ray = np.zeros((6, 6)), np.zeros((3, 6)), np.empty(3), np.empty(3)
    height, tilt = (sigma / HEIGHT_SIGMA_M) ** 2, (sigma / TILT_SIGMA) ** 2
    total = counted = 0.0
    for _ in range(STEPS):
        square[:], slope, total, counted = 0.0, np.zeros(6), 0.0, 0.0
        for n in range(len(points)):
            length = 0.0
            for i in range(3):
                seen[i] = R[i, 0] * bearings[n, 0] + R[i, 1] * bearings[n, 1] + R[i, 2] * bearings[n, 2]
                ray[i] = points[n, i] - t[i]
                length += ray[i] * ray[i]
            length = max(math.sqrt(length), 1e-6)
            ray /= length
            miss = 0.0
            for i in range(3):
                miss += (ray[i] - seen[i]) ** 2
                for k in range(3):
                    row[i, k if k < 2 else 3] = (ray[i] * ray[k] - (1.0 if i == k else 0.0)) / length
            row[0, 2], row[1, 2] = seen[1], -seen[0]
            row[1, 4], row[2, 4] = seen[2], -seen[1]
            row[0, 5], row[2, 5] = -seen[2], seen[0]
            weight = 1.0 / (1.0 + miss / (4.0 * sigma * sigma))
            total += weight * miss
            counted += weight
            for k in range(6):
                for i in range(3):
                    slope[k] += weight * row[i, k] * (ray[i] - seen[i])
                    for j in range(6):
                        square[k, j] += weight * row[i, k] * row[i, j]
        square[3, 3] += height
        slope[3] += height * t[2]
        square[4, 4] += tilt
        square[5, 5] += tilt
        slope[4] -= tilt * R[1, 2]
        slope[5] += tilt * R[0, 2]
        for k in range(6):
            square[k, k] += 1e-12
        step = -solve(square, slope)
        t = t + np.array([step[0], step[1], step[3]])
        R = rotated_by(R, step[4], step[5], step[2])
        if np.abs(step).max() < 1e-7:
            break
    return R, t, square, math.sqrt(total / max(2.0 * counted - 4.0, 1.0))

"""Trajectory errors as the SLAM literature counts them: ATE and RPE."""

from typing import Annotated, Any

import numpy as np

from omninav.pipeline import Bounds, Context, Metrics, MetricSpec, MetricStage
from omninav.stages.geometry.arrays import Array, Ints
from omninav.stages.geometry.plane.pose_errors import position_errors
from omninav.stages.geometry.plane.se2 import between, distances_along
from omninav.stages.values.drive import Drive, known


def specs(distance_m: float) -> dict[str, MetricSpec]:
    """Titles of the figures; relative errors are those over `distance_m`."""
    return {
        "absolute_trajectory_error_m": MetricSpec(title="Absolute trajectory error (ATE), aligned", better="lower"),
        "unaligned_trajectory_error_m": MetricSpec(
            title="Absolute trajectory error (ATE), not aligned", better="lower"
        ),
        "relative_position_error_m": MetricSpec(
            title=f"Relative pose error (RPE) over {distance_m:g} m, position", better="lower"
        ),
        "relative_heading_error_deg": MetricSpec(
            title=f"Relative pose error (RPE) over {distance_m:g} m, heading", better="lower"
        ),
        "relative_error_distance_m": MetricSpec(setting=True),
    }


class RelativeErrors(MetricStage):
    """Measures the absolute trajectory error after the best rigid alignment, and the relative pose error.

    Sturm et al. 2012 ("A benchmark for the evaluation of RGB-D SLAM systems", section on metrics), in the plane and
    without scale: `absolute_trajectory_error_m` is the distance that is left after the rigid motion that fits the
    estimate to the truth best in the least squares sense, `unaligned_trajectory_error_m` the same without alignment,
    which counts where the map's frame is given; `relative_position_error_m` and `relative_heading_error_deg`
    compare estimated and true motion between frames a given distance apart, every frame being a start. The last log is
    measured; nothing is given without ground truth.
    """

    distance_m: Annotated[float, Bounds(gt=0)] = 1.0
    """Metres of true path between the two frames of a relative pose error."""

    def step(self, ctx: Context, drive: Drive) -> MetricStage.Out:
        return self.Out(metrics=Metrics(trajectory_metrics(drive.last_log, self.distance_m), specs(self.distance_m)))


def trajectory_metrics(drive: Drive, distance_m: float) -> dict[str, Any]:
    """ATE and RPE of one drive by their names in metrics.json; empty with fewer than two frames to compare."""
    scored = known(drive.truth) & known(drive.estimate)
    if scored.sum() < 2:
        return {}
    estimate, truth = drive.estimate[scored], drive.truth[scored]
    starts, ends = pairs_apart(truth, distance_m)
    result: dict[str, Any] = {
        "absolute_trajectory_error_m": _summary(absolute_trajectory_errors(estimate, truth)),
        "unaligned_trajectory_error_m": _summary(position_errors(estimate, truth)),
    }
    if len(starts):
        metres, degrees = relative_pose_errors(estimate, truth, starts, ends)
        result["relative_position_error_m"] = _summary(metres)
        result["relative_heading_error_deg"] = _summary(degrees)
        result["relative_error_distance_m"] = distance_m
    return result


def align(points: Array, target: Array) -> tuple[Array, Array]:
    """Rotation (2, 2) and translation (2,) that bring points (N, 2) onto target (N, 2) with the least squared distance.

    Kabsch in the plane: the angle is that of the summed products of the centred points as complex numbers.
    """
    centre, goal = points.mean(axis=0), target.mean(axis=0)
    a, b = points - centre, target - goal
    angle = np.arctan2((a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]).sum(), (a * b).sum())
    rotation = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    return rotation, goal - rotation @ centre


def absolute_trajectory_errors(estimate: Array, truth: Array) -> Array:
    """Distances (N,) in metres between the truth and the estimate laid over it as well as a rigid motion can."""
    rotation, translation = align(estimate[:, :2], truth[:, :2])
    left: Array = np.linalg.norm(estimate[:, :2] @ rotation.T + translation - truth[:, :2], axis=1)
    return left


def pairs_apart(truth: Array, distance_m: float) -> tuple[Ints, Ints]:
    """Starts and ends of pairs: for each frame the first later one at least `distance_m` of path further on."""
    path = distances_along(truth)
    ends = np.searchsorted(path, path + distance_m - 1e-9)
    starts = np.flatnonzero(ends < len(path))
    return starts, ends[starts].astype(np.int64)


def relative_pose_errors(estimate: Array, truth: Array, starts: Ints, ends: Ints) -> tuple[Array, Array]:
    """Error of the motion from start to end: metres and degrees, each (pairs,)."""
    error = between(between(truth[starts], truth[ends]), between(estimate[starts], estimate[ends]))
    return np.hypot(error[:, 0], error[:, 1]), np.degrees(np.abs(error[:, 2]))


def _summary(errors: Array) -> dict[str, float]:
    return {
        "rmse": float(np.sqrt((errors**2).mean())),
        "mean": float(errors.mean()),
        "median": float(np.median(errors)),
        "max": float(errors.max()),
    }

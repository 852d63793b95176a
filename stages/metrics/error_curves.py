"""Errors along a drive: lap by lap, over the steps, and over the distance from the start."""

from typing import Any

import numpy as np

from omninav.pipeline import Context, Metrics, MetricStage
from omninav.stages.geometry.arrays import Array, Ints
from omninav.stages.geometry.plane.pose_errors import heading_errors_deg, position_errors
from omninav.stages.values.drive import Drive, known

HOME_M = 2.0
"""Radius of the circle around the start, metres; a lap leaves twice as far and comes back into it."""
POINTS = 60
"""Length of the lists of `over_steps`."""
STEP_M = 1.0
"""Width of a step of `over_distance`, metres."""


class ErrorCurves(MetricStage):
    """Follows the error of the estimate and of odometry alone along the last log that has ground truth.

    `laps`: a list with an entry for each lap: `frames`, the mean, median and largest position error and the mean
    heading error, and the mean of `odometry_error_m`. A lap ends where the robot is nearest to its start again, headed
    as it was there; a robot that leaves by one side, comes back and leaves by the other has not ended a lap. What
    comes after the last visit is an entry too.
    `over_steps`: lists, each entry the mean over an equal part of the frames: `step` (its middle), `position_error_m`,
    `odometry_error_m`. `over_distance`: the same over the true distance from the first true position, with the odometry
    error of the first lap alone beside it (`first_lap_odometry_error_m`); None where no frame is at that distance.
    Odometry alone starts at the first true pose and is not aligned. Nothing without ground truth.
    """

    def step(self, ctx: Context, drive: Drive) -> MetricStage.Out:
        logs = [log for log in drive.by_log if log.has_truth]
        return self.Out(metrics=Metrics(error_curves(logs[-1]) if logs else {}))


def error_curves(drive: Drive) -> dict[str, Any]:
    """Curves of one drive with ground truth by their names in metrics.json; empty where nothing was estimated."""
    scored = known(drive.truth) & known(drive.estimate)
    if not scored.any():
        return {}
    truth, frames = drive.truth[scored], np.flatnonzero(scored)
    metres, degrees = position_errors(drive.estimate[scored], truth), heading_errors_deg(drive.estimate[scored], truth)
    path = drive.odometry_alone()
    odometry = np.full(len(metres), np.nan) if path is None else position_errors(path[scored], truth)
    start = drive.truth[np.argmax(known(drive.truth))]
    laps = np.split(np.arange(len(truth)), lap_ends(truth, start))
    shares = [share for share in np.array_split(np.arange(len(truth)), min(POINTS, len(truth))) if len(share)]
    away = np.hypot(*(truth[:, :2] - start[:2]).T)
    rings = (away // STEP_M).astype(np.int64)
    by_ring = [np.flatnonzero(rings == ring) for ring in range(int(rings.max()) + 1)]
    return {
        "laps": [
            {
                "frames": len(lap),
                "position_error_m": {
                    "mean": float(metres[lap].mean()),
                    "median": float(np.median(metres[lap])),
                    "max": float(metres[lap].max()),
                },
                "heading_error_deg": {"mean": float(degrees[lap].mean())},
                "odometry_error_m": {"mean": _mean(odometry, lap)},
            }
            for lap in laps
        ],
        "over_steps": {
            "step": [float(frames[share].mean()) for share in shares],
            "position_error_m": [_mean(metres, share) for share in shares],
            "odometry_error_m": [_mean(odometry, share) for share in shares],
        },
        "over_distance": {
            "distance_m": [(ring + 0.5) * STEP_M for ring in range(len(by_ring))],
            "position_error_m": [_mean(metres, ring) for ring in by_ring],
            "first_lap_odometry_error_m": [_mean(odometry, ring[ring <= laps[0][-1]]) for ring in by_ring],
        },
    }


def lap_ends(poses: Array, start: Array) -> list[int]:
    """The rows of a drive (N, 3) at which a lap after the first begins: where it is nearest to its start, each time.

    A visit begins within `HOME_M` of the start pose (3,), headed as there (within a right angle), and ends beyond
    twice that; only what is between two visits is a lap.
    """
    away = np.hypot(*(poses[:, :2] - start[:2]).T)
    home = (away <= HOME_M) & (np.cos(poses[:, 2] - start[2]) > 0.0)
    ends: list[int] = []
    nearest: int | None = 0  # of the visit that is on; None between visits
    for row, distance in enumerate(away):
        if distance > 2.0 * HOME_M:
            if nearest is not None:
                ends.append(nearest)
            nearest = None
        elif home[row] and (nearest is None or distance < away[nearest]):
            nearest = row
    return ends[1:]  # the first visit is the start itself; the last is not left again


def _mean(values: Array, rows: Ints) -> float | None:
    there = values[rows]
    return float(there.mean()) if len(there) and np.isfinite(there).all() else None

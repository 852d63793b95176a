"""Outcome of a drive in which the robot drove by itself."""

from typing import Any

import numpy as np

from omninav.pipeline import Context, Metrics, MetricSpec, MetricStage
from omninav.stages.geometry.arrays import Array
from omninav.stages.values.drive import Drive

MIN_SPEED = 0.03
"""m/s, below which a robot makes no way: more than the noise of its wheels."""

SPECS = {
    "drive.collisions": MetricSpec(title="Collisions", better="lower", most=0.0),
    "drive.distance_m": MetricSpec(title="Distance driven", context=True),
    "drive.stopped_share": MetricSpec(
        title="Time standing or turning on the spot between moves", unit="%", better="lower"
    ),
    "drive.duration_s": MetricSpec(title="Duration", context=True),
}


class DriveSummary(MetricStage):
    """Measures how long and how far a robot drove by itself, and in a simulated world its collisions.

    `stopped_share`: of the time from its first move to its last, in which it did not move. Of a real robot nobody
    tallies contacts, and the distance is that of its odometry.
    """

    def step(self, ctx: Context, drive: Drive) -> MetricStage.Out:
        values: dict[str, Any] = {"duration_s": float(seconds_apart(drive).sum())}
        tallied = np.flatnonzero(np.isfinite(drive.distance))
        if len(tallied):
            last = tallied[-1]
            values |= {"collisions": int(drive.collisions[last]), "distance_m": float(drive.distance[last])}
        else:
            values["distance_m"] = float(np.nansum(np.hypot(drive.motion[:, 0], drive.motion[:, 1])))
        stopped = stopped_share(drive)
        if stopped is not None:
            values["stopped_share"] = stopped
        headlines = ("drive.collisions", "drive.distance_m", "drive.duration_s", "drive.stopped_share")
        return self.Out(metrics=Metrics({"frames": len(drive), "drive": values}, SPECS, headlines))


def seconds_apart(drive: Drive) -> Array:
    """Time (s) from each tick to the next; 0 from the end of a log to the start of another."""
    return np.asarray(np.diff(drive.seconds) * (np.diff(drive.log) == 0))


def stopped_share(drive: Drive) -> float | None:
    """Share of the time from the first move to the last slower than `MIN_SPEED` by odometry; None: no move."""
    apart = np.maximum(seconds_apart(drive), 1e-9)
    speeds = np.hypot(drive.motion[1:, 0], drive.motion[1:, 1]) / apart
    moves = np.flatnonzero(speeds >= MIN_SPEED)
    if not len(moves):
        return None
    driven = slice(moves[0], moves[-1] + 1)
    return float(np.average(speeds[driven] < MIN_SPEED, weights=apart[driven]))

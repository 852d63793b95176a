"""The trajectory by all that is known after a drive, and its errors."""

import dataclasses
from typing import Annotated, Any

import numpy as np

from omninav.pipeline import Bounds, Context, Metrics, Outputs, Stage
from omninav.stages.geometry.arrays import Array
from omninav.stages.values.drive import Drive, known

from .smoothing import smoothed, smoothed_with_lag
from .trajectory_errors import pose_errors, specs

WINDOW = 50
"""Frames before it that a pose uses, with a `lag`."""


class SmoothTrajectory(Stage):
    """Smooths each log's trajectory: what is seen later tells where the robot was before.

    A pose graph of odometry and the filter's estimates with their covariances and confidence, with Cauchy's loss on
    estimates (`geometry/plane/smoothing.py`). A backward pass over stored particles would need every belief of the
    drive, and knows no pose that no particle was at: before the filter had found itself, none was at the right one.
    Errors over all frames of the last log, under `smoothed`. Nothing is smoothed without odometry.
    """

    lost_m: Annotated[float, Bounds(gt=0)] = 2.5
    """Position error (m) above which the robot counts as lost."""
    lag: Annotated[int, Bounds(ge=0)] | None = None
    """Frames after it that a pose may use, as a run would that tells each pose so late; null: all of the log."""

    class Out(Outputs):
        """`drive`: with smoothed estimates; absent without odometry. `metrics`: absent without ground truth too."""

        drive: Drive | None = None
        metrics: Metrics | None = None

    def step(self, ctx: Context, drive: Drive) -> Out:
        estimate = np.full_like(drive.estimate, np.nan)
        for log in drive.by_log:
            if known(log.estimate).any() and known(log.motion).any():
                estimate[np.isin(drive.row, log.row)] = self._smoothed(log)
        if not known(estimate).any():
            return self.Out()
        smooth = dataclasses.replace(drive, estimate=estimate)
        last = smooth.last_log
        last = last.at(known(last.truth) & known(last.estimate))
        if not len(last):
            return self.Out(drive=smooth)
        values: dict[str, Any] = {"smoothed": pose_errors(last.estimate, last.truth, self.lost_m)}
        return self.Out(drive=smooth, metrics=Metrics(values, specs(self.lost_m)))

    def _smoothed(self, log: Drive) -> Array:
        trust = np.where(np.isfinite(log.confidence), log.confidence, 1.0)
        given = log.estimate, log.covariance, trust, np.nan_to_num(log.motion)
        return smoothed(*given) if self.lag is None else smoothed_with_lag(*given, self.lag, WINDOW)

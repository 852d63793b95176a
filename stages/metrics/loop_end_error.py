"""Error each time the robot comes back to where it began."""

import numpy as np

from omninav.pipeline import Context, Metrics, MetricStage
from omninav.stages.geometry.plane.pose_errors import position_errors
from omninav.stages.values.drive import Drive, known

from .error_curves import lap_ends

FRAMES = 5
"""Frames at the start that count."""


class LoopEndError(MetricStage):
    """Measures the error at the end of each lap of the last log, when the robot is back at its start.

    `returns`: a list with an entry for each lap that ended (as `ErrorCurves` counts them): `step`, the frame nearest to
    the start; `position_error_m`, the mean of the estimate's over that frame and those that follow it;
    `odometry_error_m`, that of odometry alone, from the first true pose on. Nothing without ground truth.
    """

    def step(self, ctx: Context, drive: Drive) -> MetricStage.Out:
        log = drive.last_log
        rows = np.flatnonzero(known(log.truth) & known(log.estimate))
        if not len(rows):
            return self.Out()
        truth = log.truth[rows]
        errors, path = position_errors(log.estimate[rows], truth), log.odometry_alone()
        odometry = None if path is None else position_errors(path[rows], truth)
        returns = [
            {
                "step": int(log.frames[rows[end]]),
                "position_error_m": float(errors[end : end + FRAMES].mean()),
                "odometry_error_m": None if odometry is None else float(odometry[end : end + FRAMES].mean()),
            }
            for end in lap_ends(truth, log.truth[np.argmax(known(log.truth))])
        ]
        return self.Out(metrics=Metrics({"returns": returns}))

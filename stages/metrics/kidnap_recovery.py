"""Time until the estimate is right again after the robot was kidnapped."""

import itertools
import math

import numpy as np

from omninav.pipeline import Context, Metrics, MetricSpec, MetricStage
from omninav.stages.geometry.arrays import Array, Ints
from omninav.stages.geometry.plane.pose_errors import first_settled, heading_errors_deg, position_errors
from omninav.stages.geometry.plane.se2 import between, compose, wrap
from omninav.stages.values.drive import Drive, known

SPECS = {
    "lifts.number": MetricSpec(title="Times lifted", context=True),
    "lifts.never": MetricSpec(title="Times lifted and not right again", better="lower"),
}

JUMP_M = 0.5
"""Distance between true motion and odometry of one frame from which the robot was kidnapped, metres."""
JUMP_DEG = 15.0
"""Largest difference of their turns, degrees."""
MAX_UNKNOWN = 2
"""Images without a true pose over which a kidnapping is still seen."""
MAX_KIDNAPPED, MAX_SHARE = 4, 0.2
"""Kidnappings in a drive, and their share of its frames, of which one may be exceeded: odometry that misses the truth
in more frames is of another unit, and nobody carried the robot."""


class KidnapRecovery(MetricStage):
    """Measures the time from each kidnapping of the robot until the estimate is right again, in the last log.

    The robot was kidnapped between two frames where its true motion is not that of odometry: it was turned, or put down
    elsewhere; what happens while the truth is unknown for over `MAX_UNKNOWN` images is not seen. The estimate is right
    where position and heading errors stay below 1 m and 20 degrees for ten frames (as under `converged_after_frames`).

    Under `lifts`: `number`; `never`, after how many the estimate was not right before the next one or the end; lists
    with an entry for each: `step`, and `seconds` until the estimate was right, or until the next one or the end where
    it never was. Nothing where it was not kidnapped, or without ground truth.
    """

    def step(self, ctx: Context, drive: Drive) -> MetricStage.Out:
        log = drive.last_log
        lifted, scored = kidnapped_rows(log, JUMP_M, JUMP_DEG), np.flatnonzero(known(log.truth) & known(log.estimate))
        if not len(lifted) or not len(scored):
            return self.Out()
        poses, truth = log.estimate[scored], log.truth[scored]
        metres, degrees = position_errors(poses, truth), heading_errors_deg(poses, truth)
        starts = np.searchsorted(scored, lifted)
        parts = itertools.pairwise([*starts, len(scored)])
        found = [first_settled(metres[first:end], degrees[first:end]) for first, end in parts]
        ends = zip(starts, found, [*lifted[1:] - 1, scored[-1]], strict=True)
        until = np.maximum([end if row is None else scored[start + row] for start, row, end in ends], lifted)
        values = {
            "number": len(lifted),
            "never": found.count(None),
            "step": log.frames[lifted].tolist(),
            "seconds": (log.seconds[until] - log.seconds[lifted]).tolist(),
        }
        return self.Out(metrics=Metrics({"lifts": values}, SPECS))


def kidnapped_rows(log: Drive, jump_m: float, jump_deg: float = 360.0) -> Ints:
    """Rows of a log before which the robot was kidnapped, where its true pose and odometry are known."""
    rows = np.flatnonzero(known(log.truth))
    before, rows = rows[:-1], rows[1:]
    moved = log.motion[rows]
    for back in range(1, MAX_UNKNOWN + 1):  # over images without a true pose, as that of the jump itself
        further = rows - back > before
        moved[further] = compose(log.motion[rows[further] - back], moved[further])
    gap: Array = between(log.truth[before], log.truth[rows]) - moved
    jumped = (np.hypot(gap[:, 0], gap[:, 1]) > jump_m) | (np.abs(wrap(gap[:, 2])) > math.radians(jump_deg))
    return rare(rows[jumped & (rows - before <= MAX_UNKNOWN + 1)], len(log))


def rare(rows: Ints, frames: int) -> Ints:
    """Rows of kidnappings among so many frames; none where they are too many to be some."""
    return rows[:0] if len(rows) > max(MAX_KIDNAPPED, MAX_SHARE * frames) else rows

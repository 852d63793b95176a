"""Share of images with a good estimate, and how soon one follows a bad one."""

from typing import Any

import numpy as np

from omninav.pipeline import Context, Metrics, MetricSpec, MetricStage
from omninav.stages.geometry.arrays import Bools
from omninav.stages.geometry.plane.pose_errors import first_settled, heading_errors_deg, position_errors
from omninav.stages.values.drive import Drive, known

from .kidnap_recovery import kidnapped_rows

UNIMODAL_SHARE = 0.5
"""Share of the belief that its heaviest mode must hold to be the only one; from a half on no other is as heavy."""
KIDNAPPED_M = 1.0
"""Distance between true motion and odometry that counts as a kidnapping, metres."""
WITHIN_M = 2.0
"""Largest position error of a good frame, metres."""
WITHIN_DEG = 35.0
"""Largest heading error of a good frame, degrees."""
SPECS = {
    "success.within_rate": MetricSpec(title=f"Frames within {WITHIN_M:g} m and {WITHIN_DEG:g}°", better="higher"),
    "success.at_end": MetricSpec(
        title=f"Last pose within {WITHIN_M:g} m and {WITHIN_DEG:g}°", unit="%", better="higher"
    ),
    "success.unimodal_after_frames": MetricSpec(
        title="Images until one hypothesis is left", unit="", better="lower", absent="never"
    ),
    "success.kidnapped_at": MetricSpec(title="Kidnapped before frame"),
    "success.recovered_after_frames": MetricSpec(
        title="Images until found again after the kidnapping", unit="", better="lower", absent="never"
    ),
}


class SuccessRate(MetricStage):
    """Measures the share of frames in which the estimate is close to the truth, and how soon it is after a kidnapping.

    Wolf, Burgard & Burkhardt 2005, section VI-D (2 m, 35 degrees): all frames count, global localisation at the
    beginning included, which is why 100 % is not reached (erratum 46a, docs/papers.md). Of the last log, under
    `success`: `within_rate`; `at_end`, 1 where the last frame is good, else 0; `unimodal_after_frames`, how many frames
    went by before the belief's heaviest mode, a metre and 30 degrees around it, held a given share of the belief in a
    good frame. After a kidnapping (the true pose left the path of its odometry between two frames), `kidnapped_at` is
    the frame, and `recovered_after_frames` how many frames later the estimate is good for ten in a row. Gives nothing
    without ground truth.
    """

    def step(self, ctx: Context, drive: Drive) -> MetricStage.Out:
        last = drive.last_log
        if not last.has_truth:
            return self.Out()
        scored = last.at(known(last.truth))
        good, frames = is_good(scored), np.flatnonzero(known(last.truth))
        single = good & (scored.mode_weight >= UNIMODAL_SHARE)
        found: dict[str, Any] = {
            "within_rate": float(good.mean()),
            "at_end": float(good[-1]),
            "unimodal_after_frames": int(frames[np.argmax(single)]) if single.any() else None,
        }
        kidnapped = kidnapped_rows(last, KIDNAPPED_M)
        if len(kidnapped):
            at = int(kidnapped[-1])
            later = int(np.searchsorted(frames, at))
            poses, truth = scored.estimate[later:], scored.truth[later:]
            again = first_settled(position_errors(poses, truth), heading_errors_deg(poses, truth), WITHIN_M, WITHIN_DEG)
            found |= {
                "kidnapped_at": at,
                "recovered_after_frames": None if again is None else int(frames[later + again]) - at,
            }
        return self.Out(metrics=Metrics({"success": found}, SPECS, ("success.recovered_after_frames",)))


def is_good(drive: Drive) -> Bools:
    """Which frames have an estimate close to the truth, (N,); without an estimate it is none."""
    near = position_errors(drive.estimate, drive.truth) <= WITHIN_M
    return near & (heading_errors_deg(drive.estimate, drive.truth) <= WITHIN_DEG)

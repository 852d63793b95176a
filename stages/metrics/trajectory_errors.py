"""Position and heading errors against ground truth, frame by frame."""

from collections.abc import Mapping
from typing import Annotated, Any

import numpy as np

from omninav.pipeline import Bounds, Context, Metrics, MetricSpec, MetricStage
from omninav.stages.geometry.arrays import Array
from omninav.stages.geometry.plane.pose_errors import first_settled, heading_errors_deg, position_errors
from omninav.stages.geometry.plane.se2 import path_length
from omninav.stages.values.drive import Drive, known

from .kidnap_recovery import JUMP_M, kidnapped_rows
from .truth_misfit import truth_misfit

HEADLINES = (
    "position_error_m.median",
    "position_error_m.p90",
    "heading_error_deg.median",
    "loss_rate",
    "converged_after_frames",
)
MOST_LOST = 0.05
"""Share of lost frames above which a page shows it as off: more than the few that a start at an unknown pose takes."""


def specs(lost_m: float) -> dict[str, MetricSpec]:
    """Titles of the figures; a robot counts as lost above an error of `lost_m`."""
    return {
        "position_error_m": MetricSpec(better="lower"),
        "heading_error_deg": MetricSpec(better="lower"),
        "loss_rate": MetricSpec(title=f"Lost, by more than {lost_m:g} m", better="lower", most=MOST_LOST),
        "converged_after_frames": MetricSpec(
            title="Converged", better="lower", absent="never", zero="at once", before="after"
        ),
        "frames": MetricSpec(context=True),
        "driven_m": MetricSpec(title="Distance driven", context=True),
        "odometry_alone.final_error_m": MetricSpec(title="Odometry drift at the end", better="lower"),
    }


class TrajectoryErrors(MetricStage):
    """Measures the errors of the estimate against ground truth, with those of odometry alone and of the belief's mean.

    Per log: `frames`; `driven_m`, the length of the true path, where nobody carried the robot; `position_error_m` and
    `heading_error_deg` (mean, standard deviation `std`, median, p90, max); `loss_rate`, the share of frames in which
    the robot was lost; `converged_after_frames`, how many frames went by before the error stayed below 1 m and 20
    degrees for ten frames (None if it never did); the errors and loss rate again under `after_convergence`.
    `odometry_alone` starts at the first true pose, and states how far off it ended. The top level is the last log, and
    `logs` has one entry per log where there are several. Frames without truth or without estimate are left out and
    counted.
    Warns of a truth that fits the estimates of a sure robot only once it is changed.
    """

    lost_m: Annotated[float, Bounds(gt=0)] = 2.5
    """Position error (m) above which the robot counts as lost."""
    settle_steps: Annotated[int, Bounds(ge=0)] | None = None
    """Frames at each log's start without which errors and loss rate are given again under `after_settling`. These are
    the same frames for every method, where `after_convergence` leaves out more of a method that stays lost for longer.
    None: no such entry."""

    def step(self, ctx: Context, drive: Drive) -> MetricStage.Out:
        per_log = [drive_metrics(drive, self.lost_m, self.settle_steps) for drive in drive.by_log]
        if not per_log:
            return self.Out(metrics=Metrics({"frames": 0}))
        if not drive.has_truth:
            ctx.fact("errors", "not measured: the log has no ground truth")
        elif misfit := truth_misfit(drive.last_log):
            ctx.warn(misfit)
        values = dict(per_log[-1])
        if len(per_log) > 1:
            values["logs"] = per_log
        details = ("mean_pose", "odometry_alone.after_convergence")
        return self.Out(metrics=Metrics(values, specs(self.lost_m), HEADLINES, details))


def drive_metrics(drive: Drive, lost_m: float, settle_steps: int | None = None) -> dict[str, Any]:
    """Figures of one drive, named as in metrics.json; only `frames` where there is no ground truth."""
    result: dict[str, Any] = {"frames": len(drive)}
    if not drive.has_truth:
        return result
    scored = known(drive.truth) & known(drive.estimate)
    carried = kidnapped_rows(drive, JUMP_M)
    shown = np.flatnonzero(known(drive.truth))
    jumps = drive.truth[carried] - drive.truth[shown[np.searchsorted(shown, carried) - 1]]
    result["driven_m"] = path_length(drive.truth[shown]) - float(np.hypot(jumps[:, 0], jumps[:, 1]).sum())
    result["frames_without_truth"] = int((~known(drive.truth)).sum())
    result["frames_without_estimate"] = int((known(drive.truth) & ~known(drive.estimate)).sum())
    if not scored.any():
        return result
    truth, estimate, frames = drive.truth[scored], drive.estimate[scored], np.flatnonzero(scored)
    settled = first_settled(position_errors(estimate, truth), heading_errors_deg(estimate, truth))
    windows = {"after_convergence": settled}  # the scored frame from which on each counts
    if settle_steps is not None:
        windows["after_settling"] = int(np.searchsorted(frames, settle_steps))
    result |= _errors_over(windows, estimate, truth, lost_m)
    for name, start in windows.items():
        if start is not None and result[name] is not None:
            result[name]["frames"] = len(truth) - start
    result["converged_after_frames"] = None if settled is None else int(frames[settled])
    result["mean_pose"] = _errors_over(windows, drive.mean[scored], truth, lost_m)
    odometry = drive.odometry_alone()
    if odometry is not None:
        result["odometry_alone"] = _errors_over(windows, odometry[scored], truth, lost_m)
        result["odometry_alone"]["final_error_m"] = float(position_errors(odometry[scored], truth)[-1])
    return result


def _errors_over(windows: Mapping[str, int | None], poses: Array, truth: Array, lost_m: float) -> dict[str, Any]:
    """Errors over all frames, and in each window, the estimate's for all poses: so like is compared with like."""
    within = {
        name: None if start is None or start >= len(poses) else pose_errors(poses[start:], truth[start:], lost_m)
        for name, start in windows.items()
    }
    return pose_errors(poses, truth, lost_m) | within


def pose_errors(poses: Array, truth: Array, lost_m: float) -> dict[str, Any]:
    """Position error (m), heading error (degrees) and loss rate of poses (N, 3) against truth (N, 3)."""
    position = position_errors(poses, truth)
    return {
        "position_error_m": spread(position),
        "heading_error_deg": spread(heading_errors_deg(poses, truth)),
        "loss_rate": float((position > lost_m).mean()),
    }


def spread(errors: Array) -> dict[str, float]:
    """Mean, standard deviation, median, 90th percentile and maximum (percentiles interpolate linearly)."""
    return {
        "mean": float(errors.mean()),
        "std": float(errors.std()),
        "median": float(np.median(errors)),
        "p90": float(np.percentile(errors, 90)),
        "max": float(errors.max()),
    }

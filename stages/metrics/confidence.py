"""Summary of a run's confidence where no ground truth shows how right it was."""

import math
from typing import Any

import numpy as np

from omninav.pipeline import Context, Metrics, MetricSpec, MetricStage
from omninav.stages.geometry.arrays import Array, Bools
from omninav.stages.geometry.plane.pose_errors import heading_errors_deg, position_errors
from omninav.stages.geometry.plane.se2 import between, compose, path_length
from omninav.stages.values.drive import Drive, known

SPECS = {
    "confidence.confident_share": MetricSpec(title="Images with a concentrated belief", unit="%", better="higher"),
    "confidence.first_confident_frame": MetricSpec(
        title="First image with a concentrated belief", better="lower", absent="never"
    ),
    "confidence.probability": MetricSpec(title="Confidence, median", unit="%", better="higher", least=0.5),
    "confidence.doubtful_share": MetricSpec(title="Images with a confidence below a half", unit="%", better="lower"),
    "confidence.spread_m": MetricSpec(title="Spread of the belief, median", better="lower"),
    "confidence.weight": MetricSpec(title="Belief in the estimate, median", unit="%", better="higher"),
    "confidence.path_m": MetricSpec(title="Length of the estimated path", context=True),
    "confidence.odometry_path_m": MetricSpec(title="Length of odometry's path", context=True),
    "confidence.step_off_odometry_m": MetricSpec(title="Difference of step from odometry, median", better="lower"),
    "confidence.turn_off_odometry_deg": MetricSpec(title="Difference of turn from odometry, median", better="lower"),
    "confidence.similarity": MetricSpec(title="Similarity of the best match, median"),
    "confidence.similarity_p10": MetricSpec(title="Similarity of the best match, 10th percentile"),
}
MIN_WEIGHT = 0.5
"""Share of the belief that a confident estimate holds: more than everything else together."""
MAX_SIGMA_M = 1.0
"""Largest standard deviation of the position of a confident estimate."""
JUMP_M, JUMP_DEG = 0.2, 15.0
"""Median differences from odometry's motion between images, beyond which a confident estimate jumps."""


class Confidence(MetricStage):
    """Measures a run without ground truth: how sure it was, and whether its estimates agree with odometry.

    Under `confidence`, of the last log. A belief is concentrated where the estimate holds at least `MIN_WEIGHT` of it
    and its position's largest standard deviation is at most `MAX_SIGMA_M`; that shows how sure the method is, not that
    it is right (`confident_share`, `first_confident_frame`).
    `spread_m`: that standard deviation, `weight`: that share (medians); none of them for a method whose
    belief is always a single pose. `probability`: the confidence that a monitor states (median), `doubtful_share`: the
    share of frames in which it is below a half. `path_m` and `odometry_path_m`: lengths of the estimated path and of
    odometry's; `step_off_odometry_m` and `turn_off_odometry_deg`: how far the estimate's motion from frame to frame
    is from odometry's (medians): jumps of the estimate are large there. `similarity` of the best match, where the
    comparison has one. Gives nothing where the log has ground truth. Warns of a confident estimate that jumps.
    """

    def step(self, ctx: Context, drive: Drive) -> MetricStage.Out:
        if drive.has_truth or not known(drive.estimate).any():
            return self.Out()
        values = confidence_of(drive.last_log)
        step, turn = values.get("step_off_odometry_m", 0.0), values.get("turn_off_odometry_deg", 0.0)
        mean_step = values.get("odometry_path_m", math.inf) / max(1, len(drive.last_log) - 1)
        if values.get("probability", 0.0) >= 0.5 and (turn > JUMP_DEG or step > max(JUMP_M, mean_step)):
            ctx.warn(
                f"from image to image the estimate moves by {step:.2f} m and {turn:.0f}° (medians) otherwise than "
                "odometry, however sure it is: are all images of one camera, and in the order of the drive?"
            )
        shown = (
            "probability",
            "doubtful_share",
            "confident_share",
            "spread_m",
            "step_off_odometry_m",
            "turn_off_odometry_deg",
            "similarity",
        )
        headlines = tuple(f"confidence.{name}" for name in shown if name in values)
        return self.Out(metrics=Metrics({"confidence": values}, SPECS, headlines or ("confidence.path_m",)))


def sigmas_of(drive: Drive) -> Array:
    """Largest standard deviation (m) of each estimate's position: (N,), NaN where there is none."""
    found = np.full(len(drive), np.nan)
    there = np.isfinite(drive.covariance).all(axis=(1, 2))
    found[there] = np.sqrt(np.linalg.eigvalsh(drive.covariance[there, :2, :2])[:, -1].clip(0.0))
    return found


def confident(drive: Drive) -> Bools:
    """Which of the frames have a confident estimate, see `Confidence`: (N,)."""
    sure: Bools = known(drive.estimate) & (drive.mode_weight >= MIN_WEIGHT)
    return sure & (sigmas_of(drive) <= MAX_SIGMA_M)


def confidence_of(drive: Drive) -> dict[str, Any]:
    """The figures of one log, named as in metrics.json."""
    there = known(drive.estimate)
    weights, sigmas = drive.mode_weight[there], sigmas_of(drive)[there]
    values: dict[str, Any] = {}
    if (weights < 1.0).any() or (sigmas > 0.0).any():  # not always one pose without uncertainty
        sure = np.flatnonzero(confident(drive))
        values["confident_share"] = len(sure) / len(drive)
        values["first_confident_frame"] = int(sure[0]) if len(sure) else None
        values["weight"] = float(np.median(weights))
        if (sigmas > 0.0).any():
            values["spread_m"] = float(np.nanmedian(sigmas))
    stated = drive.confidence[np.isfinite(drive.confidence)]
    if len(stated):
        values["probability"] = float(np.median(stated))
        values["doubtful_share"] = float((stated < 0.5).mean())
    path = drive.estimate[there]
    values["path_m"] = path_length(path)
    odometry = drive.odometry()
    if odometry is not None:
        values["odometry_path_m"] = path_length(odometry)
        if len(path) > 1:
            expected = compose(path[:-1], between(odometry[there][:-1], odometry[there][1:]))
            values["step_off_odometry_m"] = float(np.median(position_errors(path[1:], expected)))
            values["turn_off_odometry_deg"] = float(np.median(heading_errors_deg(path[1:], expected)))
    similar = drive.similarity[np.isfinite(drive.similarity)]
    if len(similar):
        values["similarity"] = float(np.median(similar))
        values["similarity_p10"] = float(np.percentile(similar, 10))
    return values

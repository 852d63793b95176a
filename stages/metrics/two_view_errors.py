"""Errors of relative poses of two views."""

import math
from collections.abc import Sequence

import numpy as np

from omninav.pipeline import Context, Metrics, MetricSpec, MetricStage
from omninav.stages.values.two_views import RelativeView

SPECS = {
    "two_views.success_rate": MetricSpec(title="Solved", better="higher"),
    "two_views.rotation_error_deg": MetricSpec(title="Rotation error", better="lower"),
    "two_views.direction_error_deg": MetricSpec(title="Error of the translation's direction", better="lower"),
    "two_views.samples": MetricSpec(title="RANSAC samples, median", better="lower"),
}
WITHIN_DEG = 3.0
"""Largest error of rotation and of direction at which a problem counts as solved, degrees."""


class TwoViewErrors(MetricStage):
    """Measures the angles between found and true relative poses, and how often both are small.

    Under `two_views`: `success_rate`, over all problems; `rotation_error_deg` and `direction_error_deg`, the turn that
    is left between the rotations and the angle between the translations, each median and p95 over those that were
    solved; `samples`, median.
    """

    def step(
        self, ctx: Context, truth: Sequence[RelativeView], found: Sequence[RelativeView | None]
    ) -> MetricStage.Out:
        solved = [(true, view) for true, view in zip(truth, found, strict=True) if view is not None]
        turns = np.array([_turn_between(true.rotation, view.rotation) for true, view in solved])
        ways = np.array([_angle_between(true.translation, view.translation) for true, view in solved])
        good = np.count_nonzero((turns <= WITHIN_DEG) & (ways <= WITHIN_DEG))
        values = {
            "success_rate": good / len(truth) if len(truth) else None,
            "rotation_error_deg": _spread(turns),
            "direction_error_deg": _spread(ways),
            "samples": float(np.median([view.samples for _, view in solved])) if solved else None,
        }
        return self.Out(metrics=Metrics({"two_views": values}, SPECS, ("two_views.success_rate",)))


def _spread(errors: np.ndarray) -> dict[str, float | None]:
    if not len(errors):
        return {"median": None, "p95": None}
    return {"median": float(np.median(errors)), "p95": float(np.percentile(errors, 95))}


def _turn_between(one: np.ndarray, two: np.ndarray) -> float:
    left = one.T @ two
    axis = 0.5 * np.array([left[2, 1] - left[1, 2], left[0, 2] - left[2, 0], left[1, 0] - left[0, 1]])
    return math.degrees(math.atan2(float(np.linalg.norm(axis)), 0.5 * (float(np.trace(left)) - 1.0)))


def _angle_between(one: np.ndarray, two: np.ndarray) -> float:
    return math.degrees(math.atan2(float(np.linalg.norm(np.cross(one, two))), float(one @ two)))

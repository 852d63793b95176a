"""Calibration of a localisation: its confidence and its ellipses against ground truth."""

import math
from typing import Annotated, Any

import numpy as np

from omninav.pipeline import Bounds, Context, Metrics, MetricSpec, Outputs, Stage
from omninav.stages.geometry.plane.pose_errors import heading_errors_deg, position_errors
from omninav.stages.geometry.probability.reliability import (
    area_under_roc,
    expected_calibration_error,
    reliability,
    squared_mahalanobis,
)
from omninav.stages.values.confidence import ConfidenceReliability
from omninav.stages.values.drive import Drive, known

MIN_SHARE_IN_ELLIPSE = 0.85
"""Share of true positions in 95 % ellipses below which these are too small: of 20 frames that are independent of each
other (in a drive, those some metres apart) right ellipses hold 17 or more with a probability of 0.98."""
MOST_MISCALIBRATED = 0.1
"""Calibration error of a confidence above which it is shown as off: as much as one of the ten bins is wide."""
SPECS = {
    "calibration.lost_auroc": MetricSpec(title="Lost frames told by a low confidence (AUROC)", better="higher"),
    "calibration.wrong_auroc": MetricSpec(title="Wrong frames told by a low confidence (AUROC)", better="higher"),
    "calibration.expected_error": MetricSpec(
        title="Calibration error of the confidence (ECE)", unit="%", better="lower", most=MOST_MISCALIBRATED
    ),
    "calibration.ellipse_50": MetricSpec(title="50 % ellipse holds", unit="%"),
    "calibration.ellipse_95": MetricSpec(title="95 % ellipse holds", unit="%", least=MIN_SHARE_IN_ELLIPSE),
    "calibration.nees": MetricSpec(title="Squared error over covariance (NEES, 2 is right)"),
}


class Calibration(Stage):
    """Measures whether the stated confidence and the covariance ellipses agree with ground truth.

    Of the last log, under `calibration`. Where a monitor states a confidence: `expected_error`, the mean distance
    between stated probability and observed share over ten bins (expected calibration error, ECE); `wrong_auroc`, the
    probability that a frame outside the tolerance has a lower confidence than one within; `lost_auroc`, that a lost one
    has a lower one than the others; None where there are no such frames. Where estimates have a covariance:
    `ellipse_50`, `ellipse_95`, the share of true positions within the ellipse that should hold 50 and 95 %, and `nees`,
    the mean normalised estimation error squared e' C^-1 e of the position, 2 where covariances are right (Bar-Shalom,
    Li & Kirubarajan 2001, section 5.4), larger where they are too small.
    """

    within_m: Annotated[float, Bounds(gt=0)] = 0.5
    """Tolerance in position (m), as the monitor's."""
    within_deg: Annotated[float, Bounds(gt=0, le=180)] = 10.0
    """Tolerance in heading, as the monitor's; wider where the true heading is not known so well."""
    lost_m: Annotated[float, Bounds(gt=0)] = 2.5
    """Position error (m) above which the robot counts as lost."""

    class Out(Outputs):
        """Both absent without ground truth, `reliability` without a confidence."""

        metrics: Metrics | None = None
        reliability: ConfidenceReliability | None = None

    def step(self, ctx: Context, drive: Drive) -> Out:
        last = drive.last_log
        last = last.at(known(last.truth) & known(last.estimate))
        values = covered(last)
        stated = last.at(np.isfinite(last.confidence))
        held = None
        if len(stated):
            errors = position_errors(stated.estimate, stated.truth)
            right = (errors <= self.within_m) & (heading_errors_deg(stated.estimate, stated.truth) <= self.within_deg)
            found = reliability(stated.confidence, right)
            values |= {
                "expected_error": expected_calibration_error(found),
                "wrong_auroc": area_under_roc(-stated.confidence, ~right),
                "lost_auroc": area_under_roc(-stated.confidence, errors > self.lost_m),
                "right_share": float(right.mean()),
            }
            held = ConfidenceReliability(*found, self.within_m, self.within_deg)
        if not values:
            return self.Out()
        specs = SPECS | {
            "calibration.right_share": MetricSpec(
                title=f"Frames within {self.within_m:g} m and {self.within_deg:g}°", unit="%", better="higher"
            )
        }
        too_small = values.get("ellipse_95", 1.0) < MIN_SHARE_IN_ELLIPSE
        headlines = (*(("calibration.ellipse_95",) if too_small else ()), "calibration.expected_error")
        return self.Out(metrics=Metrics({"calibration": values}, specs, headlines), reliability=held)


def covered(drive: Drive) -> dict[str, Any]:
    """Shares of true positions in the ellipses of 50 and 95 %, and the mean normalised error; empty without any."""
    errors = (drive.estimate - drive.truth)[:, :2]
    squares = squared_mahalanobis(errors, drive.covariance[:, :2, :2])
    squares = squares[np.isfinite(squares)]
    if not len(squares):
        return {}
    within = {f"ellipse_{share}": -2.0 * math.log(1.0 - share / 100) for share in (50, 95)}  # chi squared, 2 degrees
    shares = {name: float((squares <= limit).mean()) for name, limit in within.items()}
    return shares | {"nees": float(squares.mean())}

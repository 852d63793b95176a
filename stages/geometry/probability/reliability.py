"""Calibration of stated probabilities: reliability, calibration error, separation."""

import math
from typing import NamedTuple

import numpy as np

from omninav.stages.geometry.arrays import Array, Bools, Ints

ELLIPSE_95 = -2.0 * math.log(0.05)
"""Squared error of a position, in units of its covariance, at the edge of the 95 % ellipse (chi squared, 2 degrees)."""
BINS = 10
"""Bins of probability."""


class Reliability(NamedTuple):
    """Statements by their probability, in bins of equal width; empty bins are left out: (B,) each.

    `stated`: mean probability, `observed`: share of those that came true, `counts`: how many there are.
    """

    stated: Array
    observed: Array
    counts: Ints


def reliability(probabilities: Array, true: Bools) -> Reliability:
    """Sorts statements (N,) into bins of probability. DeGroot & Fienberg 1983."""
    which = np.minimum((probabilities * BINS).astype(np.int64), BINS - 1)
    counts = np.bincount(which, minlength=BINS)
    full = counts > 0
    stated, observed = (np.bincount(which, each, minlength=BINS)[full] / counts[full] for each in (probabilities, true))
    return Reliability(stated, observed, counts[full])


def expected_calibration_error(found: Reliability) -> float:
    """Mean distance of stated and observed shares over all statements. Naeini, Cooper & Hauskrecht 2015."""
    return float((np.abs(found.stated - found.observed) * found.counts).sum() / found.counts.sum())


def area_under_roc(scores: Array, positive: Bools) -> float | None:
    """The probability that a positive has a higher score than a negative, equal ones a half; None without one of each.

    `scores`, `positive`: (N,). The area under the receiver operating characteristic: Hanley & McNeil 1982.
    """
    above, below = scores[positive], np.sort(scores[~positive])
    if not (len(above) and len(below)):
        return None
    lower, upper = np.searchsorted(below, above), np.searchsorted(below, above, side="right")
    return float((lower + upper).sum() / (2 * len(above) * len(below)))


def squared_mahalanobis(errors: Array, covariances: Array) -> Array:
    """Errors (N, D) in units of their covariances (N, D, D), squared: (N,); NaN where a covariance has no inverse."""
    found = np.full(len(errors), np.nan)
    finite = np.flatnonzero(np.isfinite(covariances).all(axis=(1, 2)) & np.isfinite(errors).all(axis=1))
    sound = finite[np.linalg.eigvalsh(covariances[finite])[:, 0] > 1e-12]
    solved = np.linalg.solve(covariances[sound], errors[sound, :, None])[..., 0]
    found[sound] = (errors[sound] * solved).sum(axis=1)
    return found

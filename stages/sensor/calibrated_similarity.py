"""Similarities as likelihood ratios of the right against a wrong place."""

import math

import numpy as np
import numpy.typing as npt

from omninav.stages.geometry.probability.evidence import evidence_novelty
from omninav.stages.geometry.probability.likelihood_ratio import (
    MAX_LOG_ODDS,
    saturated_ratios,
    standard_score,
    standard_scores,
)
from omninav.stages.values.calibration import SimilarityCalibration
from omninav.stages.values.similarity import Similarities

OUTLIERS = 0.1
"""Share of images that their place does not explain: blocked, changed, or beside the map."""
BROKEN = 0.002
"""Share of images that do not look like the one before although the robot was not carried: none of 3000 in twelve
offices, two of 900 on recordings."""


def likelihood_ratios(similarities: Similarities, calibration: SimilarityCalibration) -> npt.NDArray[np.float32]:
    """The ratio for each compared reference and heading: (references, headings) float32, 1 says nothing."""
    scores = standard_scores(similarities.values, similarities.sampling_weight)
    return saturated_ratios(scores, calibration.slope, calibration.middle, OUTLIERS, calibration.images)


def novelty_and_kidnapping(
    similarities: Similarities, calibration: SimilarityCalibration, driven_m: float | None, independence_m: float
) -> tuple[float, float]:
    """How new an image is, in [0, 1], and how many times likelier than usual the robot was carried, from 1 on.

    By the distance driven (`evidence_novelty`); but where the robot has hardly moved, an image looks like the one
    before. One that looks like another place is all new, and somebody may have carried the robot.
    """
    novelty = evidence_novelty(driven_m, independence_m)
    if similarities.last_view is None:
        return novelty, 1.0
    score = standard_score(similarities.last_view, similarities.best, similarities.sampling_weight)
    same = math.exp(min(max(calibration.slope * (score - calibration.middle), -MAX_LOG_ODDS), MAX_LOG_ODDS))
    ratio = max(1.0 / (BROKEN + (1.0 - BROKEN) * same), 1.0) ** (1.0 - novelty)
    return novelty + (1.0 - novelty) / (1.0 + same), ratio

"""Similarities as likelihood ratios of the right against a wrong place."""

import math

import numpy as np

from omninav.stages.geometry.arrays import Floats
from omninav.stages.geometry.probability.evidence import MIN_SPREAD, evidence_novelty
from omninav.stages.geometry.probability.likelihood_ratio import (
    ratios_of,
    saturated_ratios,
    standard_score,
    standard_scores,
)
from omninav.stages.values.calibration import SimilarityCalibration
from omninav.stages.values.pose import AssumedMotion, BridgedMotion, Motion
from omninav.stages.values.similarity import Similarities

OUTLIERS = 0.1
"""Share of images that their place does not explain: blocked, changed, or beside the map."""
CARRIED = 1e-4
"""Probability that a robot is carried between two images."""
BROKEN = 0.002
"""Share of images that do not look like the one before although the robot was not carried: two of 1800 in seven
offices, three of 600 on recordings."""


def likelihood_ratios(similarities: Similarities, calibration: SimilarityCalibration) -> Floats:
    """The ratio for each compared reference and heading: (references, headings) float32, 1 shows nothing."""
    scores = standard_scores(similarities.values, similarities.sampling_weight)
    return saturated_ratios(scores, calibration.slope, calibration.middle, OUTLIERS, calibration.images)


def novelty_and_kidnapping(
    similarities: Similarities, calibration: SimilarityCalibration | None, motion: Motion | None, independence_m: float
) -> tuple[float, float]:
    """Gives the novelty of an image, in [0, 1], and the probability that the robot was carried since the last one.

    The novelty follows from the distance driven (`evidence_novelty`), up to `independence_m` metres. But where the
    robot has hardly moved, as odometry has measured, an image looks like the one before. One that looks like another
    place instead, by a `calibration`, is all new, and the robot may have been carried.
    """
    driven = None if motion is None else math.hypot(motion.x, motion.y)
    novelty = evidence_novelty(driven, independence_m)
    measured = motion is not None and not isinstance(motion, AssumedMotion | BridgedMotion)
    if calibration is None or similarities.last_view is None or not measured:
        return novelty, 0.0
    if calibration.slope <= 0.0 or similarities.spread <= MIN_SPREAD:
        return novelty, 0.0
    score = standard_score(similarities.last_view, similarities.best, similarities.sampling_weight)
    same = float(ratios_of(np.array([score], np.float32), calibration.slope, calibration.middle)[0])
    carried = CARRIED / (CARRIED + BROKEN + (1.0 - BROKEN) * same)
    return novelty + (1.0 - novelty) / (1.0 + same), (1.0 - novelty) * carried

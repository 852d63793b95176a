"""Similarities as likelihood ratios of the right against a wrong place."""

import numpy as np
import numpy.typing as npt

from omninav.stages.geometry.probability.likelihood_ratio import saturated_ratios, standard_scores
from omninav.stages.values.calibration import SimilarityCalibration
from omninav.stages.values.similarity import Similarities

OUTLIERS = 0.1
"""Share of images that their place does not explain: blocked, changed, or beside the map."""


def likelihood_ratios(similarities: Similarities, calibration: SimilarityCalibration) -> npt.NDArray[np.float32]:
    """The ratio for each compared reference and heading: (references, headings) float32, 1 says nothing."""
    scores = standard_scores(similarities.values, similarities.sampling_weight)
    return saturated_ratios(scores, calibration.slope, calibration.middle, OUTLIERS, calibration.images)

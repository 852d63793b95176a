"""Similarities as likelihood ratios of the right against a wrong place."""

from typing import Annotated

import numpy as np
import numpy.typing as npt

from omninav.pipeline import Bounds
from omninav.stages.geometry.probability.likelihood_ratio import saturated_ratios, standard_scores
from omninav.stages.values.calibration import SimilarityCalibration
from omninav.stages.values.similarity import Similarities

Outliers = Annotated[float, Bounds(gt=0, lt=1)]


def likelihood_ratios(
    similarities: Similarities, calibration: SimilarityCalibration, outliers: float
) -> npt.NDArray[np.float32]:
    """The ratio for each compared reference and heading: (references, headings) float32, 1 says nothing."""
    scores = standard_scores(similarities.values, similarities.sampling_weight)
    return saturated_ratios(scores, calibration.slope, calibration.middle, outliers, calibration.images)

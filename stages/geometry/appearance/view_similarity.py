"""Similarity of two views from their distance."""

from typing import Literal

import numpy as np

from omninav.stages.geometry.arrays import Array

Shape = Literal["linear", "quadratic", "cosine", "step"]


def similarity(distances: Array, threshold: float, shape: Shape) -> Array:
    """Similarity of views at these distances: 1 at 0, falling to 0 at `threshold` (`step`: 1 up to there).

    S of Gross, Koenig & Mueller 2005, section 2.2, whose shape is not given (erratum 12a in docs/papers.md).
    """
    share = np.clip(distances / threshold, 0.0, 1.0) if threshold > 0.0 else (distances > 0.0).astype(np.float64)
    match shape:
        case "linear":
            similarities: Array = 1.0 - share
        case "quadratic":
            similarities = 1.0 - share**2
        case "cosine":
            similarities = 0.5 + 0.5 * np.cos(np.pi * share)
        case "step":
            similarities = (share < 1.0).astype(np.float64)
    return similarities

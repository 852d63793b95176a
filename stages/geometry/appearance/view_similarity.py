"""Similarity of two views from their distance."""

import numpy as np

from omninav.stages.geometry.arrays import Array


def similarity(distances: Array, threshold: float) -> Array:
    """Similarity of views at these distances: 1 at 0, falling linearly to 0 at `threshold`.

    S of Gross, Koenig & Mueller 2005, section 2.2, whose shape is not given (erratum 12a in docs/papers.md).
    """
    share = np.clip(distances / threshold, 0.0, 1.0) if threshold > 0.0 else (distances > 0.0).astype(np.float64)
    return np.asarray(1.0 - share)

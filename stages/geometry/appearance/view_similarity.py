"""How alike two views are, by how far apart they are."""

from typing import Literal

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
Shape = Literal["linear", "quadratic", "cosine", "step"]


def similarity(distances: Array, limit: float, shape: Shape) -> Array:
    """How alike views at these distances are: 1 at 0, falling to 0 at `limit` (`step`: 1 up to there).

    S of Gross, Koenig & Mueller 2005, section 2.2, whose shape is not given (erratum 12a in docs/papers.md).
    """
    share = np.clip(distances / limit, 0.0, 1.0) if limit > 0.0 else (distances > 0.0).astype(np.float64)
    match shape:
        case "linear":
            alike: Array = 1.0 - share
        case "quadratic":
            alike = 1.0 - share**2
        case "cosine":
            alike = 0.5 + 0.5 * np.cos(np.pi * share)
        case "step":
            alike = (share < 1.0).astype(np.float64)
    return alike

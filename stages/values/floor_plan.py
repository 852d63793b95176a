"""A world from above."""

import numpy as np
import numpy.typing as npt

from omninav.pipeline import Value


class FloorPlan(Value):
    """The obstacles on a simulated world's floor, for plots: truth.

    `outlines`: (B, 4, 2) corners in metres, map frame. `width`, `depth`: of the floor, from 0, 0.
    """

    is_truth = True
    outlines: npt.NDArray[np.float64]
    width: float
    depth: float

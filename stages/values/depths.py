"""How far away the things are that features show."""

import numpy as np
import numpy.typing as npt

from omninav.pipeline import Value

Array = npt.NDArray[np.float64]


class Depths(Value):
    """Metres from the camera to what features show: `patches` (N,), and `ends` (M, 2) of column segments. Truth."""

    is_truth = True

    patches: Array
    ends: Array

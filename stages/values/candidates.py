"""The references of a map that are compared with the current view."""

from typing import Annotated

import numpy as np
import numpy.typing as npt

from omninav.pipeline import Bounds, Value
from omninav.pipeline.graph.contents import Shape


class Candidates(Value):
    """References of a map to compare with the current view; both fields None: all of them.

    `references` (N,): their indices, ascending. `sampling_weight` (N,): how many references of the map each represents,
    where the others are only sampled. Sums weighted by it are unbiased estimates for the whole map.
    """

    references: Annotated[npt.NDArray[np.int64] | None, Shape("N"), Bounds(ge=0)] = None
    sampling_weight: Annotated[npt.NDArray[np.float64] | None, Shape("N"), Bounds(gt=0)] = None

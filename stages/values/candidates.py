"""The references of a map that are compared with the current view."""

from typing import Annotated

from omninav.pipeline import Bounds, Shape, Value
from omninav.stages.geometry.arrays import Array, Ints


class Candidates(Value):
    """References of a map to compare with the current view; both fields None: all of them.

    `references` (N,): their indices, ascending. `sampling_weight` (N,): how many references of the map each represents,
    where the others are only sampled. Sums weighted by it are unbiased estimates for the whole map.
    """

    references: Annotated[Ints | None, Shape("N"), Bounds(ge=0)] = None
    sampling_weight: Annotated[Array | None, Shape("N"), Bounds(gt=0)] = None

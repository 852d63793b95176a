"""Depths of the things that features show."""

from typing import Annotated

from omninav.pipeline import Shape, Value
from omninav.stages.geometry.arrays import Array


class Depths(Value):
    """Metres from the camera to what features show: `patches` (N,), and `ends` (M, 2) of column segments. Truth."""

    is_truth = True

    patches: Annotated[Array, Shape("N", finite=False)]
    ends: Annotated[Array, Shape("M", 2, finite=False)]

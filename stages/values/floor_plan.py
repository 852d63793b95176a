"""A world from above."""

from typing import Annotated

from omninav.pipeline import Bounds, Shape, Value
from omninav.stages.geometry.arrays import Array


class FloorPlan(Value):
    """The obstacles on a simulated world's floor, for plots: truth.

    `outlines`: (B, 4, 2) corners in metres, map frame. `width`, `depth`: of the floor, from 0, 0.
    """

    is_truth = True
    outlines: Annotated[Array, Shape("B", 4, 2)]
    width: Annotated[float, Bounds(gt=0)]
    depth: Annotated[float, Bounds(gt=0)]

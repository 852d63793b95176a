"""Per-tick statistics of a closed-loop drive."""

from typing import Annotated

from omninav.pipeline import Bounds, Value


class DriveTally(Value):
    """How often a simulated robot came into contact with something so far, and how far it drove (m): truth."""

    is_truth = True
    collisions: Annotated[int, Bounds(ge=0)]
    distance: Annotated[float, Bounds(ge=0)]

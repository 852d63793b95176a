"""What became of a robot that drives by itself."""

from omninav.pipeline import Value


class DriveTally(Value):
    """How often a simulated robot came into contact with something so far, and how far it drove (m): truth."""

    is_truth = True
    collisions: int
    distance: float

"""Per-tick statistics of a closed-loop drive."""

from typing import Annotated

from omninav.pipeline import Bounds, Value


class EpisodeStatistics(Value):
    """Contacts of a simulated robot with something so far, and the distance it drove (m): truth."""

    is_truth = True
    collisions: Annotated[int, Bounds(ge=0)]
    distance: Annotated[float, Bounds(ge=0)]

"""Visual distance of the present view to the places of a map."""

from typing import Annotated

from omninav.pipeline import Bounds, Shape, Value
from omninav.stages.geometry.arrays import Array, Ints


class VisualDistances(Value):
    """Visual distance of the present view to each place's medoid (Goedeme et al. 2007, section 4.2).

    `distances` (P,): 0 is the same, inf has nothing in common. `turns` (P,): how far the robot is turned, counter-
    clockwise, against the medoid's heading (rad); 0 where the distance is inf. `matches` (P,): features that matched.
    """

    distances: Annotated[Array, Shape("P", finite=False), Bounds(ge=0)]
    turns: Annotated[Array, Shape("P")]
    matches: Annotated[Ints, Shape("P"), Bounds(ge=0)]

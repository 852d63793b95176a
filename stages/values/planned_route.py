"""The way to a goal through the places of a map."""

from typing import Annotated, Literal

from omninav.pipeline import Bounds, Shape, Value
from omninav.stages.geometry.arrays import Ints

from .commands import GoalPoint


class PlannedRoute(Value):
    """Through which `places` (K,) the robot is to go, the believed one first, the goal last; none before it is known.

    On a map of references these are references, and the goal is a point beside them, `goal`. `state`: `locating`, it is
    not yet known where the robot is; `under way`; `arrived`; `gave up`; and `why`, where one would ask. `number`:
    another way has another, from 0; -1 before the first. `asked`: how many goals the robot was sent to before.
    """

    places: Annotated[Ints, Shape("K"), Bounds(ge=0)]
    state: Literal["locating", "under way", "arrived", "gave up"]
    number: Annotated[int, Bounds(ge=-1)]
    why: str = ""
    goal: GoalPoint | None = None
    asked: Annotated[int, Bounds(ge=0)] = 0

"""The way to a goal through the places of a map."""

from typing import Literal

import numpy as np
import numpy.typing as npt

from omninav.pipeline import Value


class PlannedRoute(Value):
    """Through which `places` (K,) the robot is to go, the believed one first, the goal last; none before it is known.

    `state`: `locating`, it is not yet known where the robot is; `under way`; `arrived`; `gave up`; and `why`, where one
    would ask. `number`: another way has another, from 0; -1 before the first.
    """

    places: npt.NDArray[np.int64]
    state: Literal["locating", "under way", "arrived", "gave up"]
    number: int
    why: str = ""

"""The poses that a map of any kind holds."""

import numpy as np
import numpy.typing as npt

from .maps import ReferenceGraph
from .view_mixtures import ViewMixtures

AnyMap = ReferenceGraph | ViewMixtures
"""Every kind of map that has poses."""


def map_poses(map: AnyMap | None) -> npt.NDArray[np.float64]:
    """A graph's references, or the means of a map of mixtures: (N, 3) x, y (m), heading (rad); none without a map."""
    if map is None:
        return np.empty((0, 3))
    return map.poses if isinstance(map, ReferenceGraph) else map.means

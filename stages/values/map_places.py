"""The poses that a map of any kind holds."""

import numpy as np

from omninav.stages.geometry.arrays import Array

from .maps import ReferenceGraph
from .topological_map import TopologicalMap
from .view_mixtures import ViewMixtures

AnyMap = ReferenceGraph | ViewMixtures | TopologicalMap
"""Every kind of map that has poses."""


def map_poses(map: AnyMap | None) -> Array:
    """A graph's references, the means of a map of mixtures, or where the pictures of a topological map were taken.

    (N, 3) x, y (m), heading (rad); none without a map.
    """
    if map is None:
        return np.empty((0, 3))
    return map.means if isinstance(map, ViewMixtures) else map.poses

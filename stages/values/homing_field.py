"""Homing vectors from many points towards one target."""

import numpy as np

from omninav.pipeline import Value
from omninav.stages.geometry.arrays import Array, Ints


class HomingField(Value):
    """Poses of views, and the homing vector from each.

    `target` (3,) and `poses` (N, 3): m, m, rad on the map. `directions` (N,): of the homing vectors on the map (rad);
    `errors` (N,): how far (rad) they miss the target's direction. Both NaN where the target was not found. `inliers`
    (N,): features that agree.
    """

    target: Array
    poses: Array
    directions: Array
    errors: Array
    inliers: Ints

    @property
    def metres(self) -> Array:
        """Distance to the target: (N,)."""
        return np.asarray(np.hypot(*(self.poses[:, :2] - self.target[:2]).T))

"""Limits the number of views of a map."""

import numpy as np

from omninav.stages.geometry.arrays import Bools
from omninav.stages.values.view_mixtures import ViewMixtures


def within_cap(map: ViewMixtures, max_views: int) -> Bools:
    """Which views (R,) stay in a map of at most `max_views`; 0: all of them.

    The weakest go first: those with the smallest sum of weights, then the fewest observations, then the oldest. Views
    inserted in the map's current step go last, since they could gain no weight yet.
    """
    surplus = len(map) - max_views
    kept = np.ones(len(map), np.bool_)
    if max_views and surplus > 0:
        weight = np.bincount(map.owner, map.weights, len(map))
        count = np.bincount(map.owner, map.counts, len(map))
        new = map.born >= map.steps
        kept[np.lexsort((map.ids, count, weight, new))[:surplus]] = False
    return kept

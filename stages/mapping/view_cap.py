"""A hard limit on how many views a map keeps."""

import numpy as np
import numpy.typing as npt

from omninav.stages.values.view_mixtures import ViewMixtures


def within_cap(map: ViewMixtures, most: int) -> npt.NDArray[np.bool_]:
    """Which views (R,) stay where a map may keep no more than `most`; 0: all of them.

    The weakest go first: those whose weights add up to the least, of equals those that took in the fewest observations,
    of equals the oldest. Views that came in the map's present step are the last to go: they could gain no weight yet.
    """
    surplus = len(map) - most
    kept = np.ones(len(map), np.bool_)
    if most and surplus > 0:
        weight = np.bincount(map.owner, map.weights, len(map))
        count = np.bincount(map.owner, map.counts, len(map))
        fresh = map.born >= map.steps
        kept[np.lexsort((map.names, count, weight, fresh))[:surplus]] = False
    return kept

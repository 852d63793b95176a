"""What a tick did to a map of views."""

from collections.abc import Mapping
from typing import Literal

import numpy as np
import numpy.typing as npt

from omninav.stages.values.view_mixtures import ViewEvent, ViewMixtures

Ints = npt.NDArray[np.int64]


def view_event(
    map: ViewMixtures,
    names_before: Ints,
    changed: Ints,
    seen: Mapping[int, int],
    why: Literal["", "forgotten", "merged", "full"] = "",
) -> ViewEvent:
    """The event of a tick: what came and went since the map held `names_before` (R0,), and how the changed ones stand.

    `changed`: names (any order, also several times) of views whose mixtures were changed; those that are gone are left
    out. `seen`: of each name given since then, the tick in which the view was seen. `why`: of the removals, where there
    are any.
    """
    removed = np.setdiff1d(names_before, map.names, assume_unique=True)
    inserted = np.setdiff1d(map.names, names_before, assume_unique=True)
    names, rows, _ = np.intersect1d(map.names, changed, return_indices=True)
    weights, places, parts = np.zeros(len(rows)), np.zeros((len(rows), 2)), np.zeros(len(rows), np.int64)
    if len(rows) and len(map.owner):
        by_owner = np.lexsort((map.weights, map.owner))  # each view's heaviest component comes last
        end = np.searchsorted(map.owner[by_owner], rows, side="right")
        parts = end - np.searchsorted(map.owner[by_owner], rows, side="left")
        heaviest = by_owner[np.maximum(end - 1, 0)]
        weights = np.where(parts > 0, map.weights[heaviest], 0.0)
        places = np.where(parts[:, None] > 0, map.means[heaviest, :2], 0.0)
    return ViewEvent(
        views=len(map),
        components=len(map.weights),
        inserted=inserted,
        seen=np.array([seen[name] for name in inserted.tolist()], np.int64),
        removed=removed,
        why=why if len(removed) else "",
        changed=names,
        weights=weights,
        places=places,
        parts=parts.astype(np.int64),
    )

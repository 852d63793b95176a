"""Describes the changes of a tick to a map of views."""

from collections.abc import Mapping
from typing import Literal

import numpy as np

from omninav.stages.geometry.arrays import Ints
from omninav.stages.values.view_mixtures import ViewEvent, ViewMixtures


def view_event(
    map: ViewMixtures,
    ids_before: Ints,
    changed: Ints,
    seen: Mapping[int, int],
    why: Literal["", "forgotten", "merged", "full"] = "",
) -> ViewEvent:
    """The event of a tick: views inserted and removed since the map had `ids_before` (R0,), and the changed ones.

    `changed`: ids (any order, repeated or not) of views whose mixtures changed; removed ones are left out. `seen`: for
    each id given since then, the tick in which the view was seen. `why`: the reason of removals.
    """
    removed = np.setdiff1d(ids_before, map.ids, assume_unique=True)
    inserted = np.setdiff1d(map.ids, ids_before, assume_unique=True)
    ids, rows, _ = np.intersect1d(map.ids, changed, return_indices=True)
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
        changed=ids,
        weights=weights,
        places=places,
        parts=parts.astype(np.int64),
    )

"""Places that several drives have in common."""

import math

import numpy as np

from omninav.stages.geometry.plane.drive_graph import Closures
from omninav.stages.values.sessions import Sessions


def closures_between(sessions: Sessions, max_distance: float, min_gap_m: float, samples: int) -> Closures:
    """For each view the most alike of each earlier drive, and of its own at least `min_gap_m` metres back.

    A pair counts up to `max_distance`, in the views' unit. Of more than `samples` views so many, evenly spaced, look
    for partners.
    """
    values, drives, driven = sessions.values, sessions.drives, sessions.driven
    pairs, turns = [], []
    for query in np.unique(np.linspace(0, len(sessions) - 1, min(samples, len(sessions))).astype(np.int64)).tolist():
        view = sessions.view(query)
        distances = view.distances(values[:query])
        distances[(drives[:query] == drives[query]) & (driven[:query] > driven[query] - min_gap_m)] = math.inf
        best = [
            int(rows[distances[rows].argmin()])
            for drive in range(drives[query] + 1)
            if len(rows := np.flatnonzero(drives[:query] == drive))
        ]
        near = np.array([row for row in best if distances[row] <= max_distance], np.int64)
        if len(near):
            pairs += [(row, query) for row in near.tolist()]
            turns += view.turns(values[near]).tolist()
    return Closures(np.array(pairs, np.int64).reshape(-1, 2), np.array(turns))

"""Samples the references that are not compared for themselves, so that they are represented."""

import numpy as np

from omninav.stages.geometry.arrays import Ints
from omninav.stages.values.candidates import Candidates


def with_background(chosen: Ints, references: int, background: int) -> Candidates:
    """References `chosen` (N,), ascending, and `background` others at even steps over the map, always the same ones.

    Each of the others represents as many as are left out, so that sums by sampling weight are estimates for the whole
    map: the chosen ones, which look most like the view, count for themselves alone. What is read of a map that lies in
    its file is read again and again, and not all of it little by little. All references where none is chosen, or no
    others would be left out.
    """
    others = references - len(chosen)
    if not len(chosen) or others <= background:
        return Candidates()
    even = np.linspace(0, references - 1, background).astype(np.int64)
    even = even[~np.isin(even, chosen)]
    together = np.concatenate([chosen, even])
    weight = np.concatenate([np.ones(len(chosen)), np.full(len(even), others / max(len(even), 1))])
    order = np.argsort(together, kind="stable")
    return Candidates(together[order], weight[order])

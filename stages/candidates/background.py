"""Samples the references that are not compared for themselves, so that they are represented."""

import math

import numpy as np
import numpy.typing as npt

from omninav.stages.values.candidates import Candidates

Array = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]

GOLDEN_RATIO = (math.sqrt(5.0) - 1.0) / 2.0
"""Golden ratio: the fractional parts of its multiples fill an interval evenly."""


def with_background(chosen: Ints, references: int, background: int, turn: int) -> Candidates:
    """References `chosen` (N,), ascending, and a sample of `background` of the map's other ones.

    The background is sampled at equal steps along the map, with another offset at each `turn`, so that all references
    come up; each represents as many as the step is long. All references where none is chosen, or no others would be
    left out.
    """
    others = references - len(chosen)
    if not len(chosen) or others <= background:
        return Candidates()
    if not background:
        return Candidates(chosen, np.ones(len(chosen)))
    step = others / background
    first = (turn * GOLDEN_RATIO % 1.0) * step
    taken = np.minimum((first + step * np.arange(background)).astype(np.int64), others - 1)
    # chosen[i] has chosen[i] - i others before it: which of the others has the number n, without a list of them all.
    sampled = taken + np.searchsorted(chosen - np.arange(len(chosen)), taken, side="right")
    found, first_of = np.unique(np.concatenate([chosen, sampled]), return_index=True)
    return Candidates(found, np.where(first_of < len(chosen), 1.0, step))


def with_even_background(chosen: Ints, references: int, background: int) -> Candidates:
    """References `chosen` (N,), ascending, and `background` others at even steps over the map, always the same ones.

    What is read of a map that lies in its file is then read again and again, and not all of it little by little.
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

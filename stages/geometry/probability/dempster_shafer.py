"""Dempster-Shafer evidence about one hypothesis: how much speaks for it, how much against, how much for neither.

Masses are arrays (..., 3): m(H), m(not H) and m(H or not H), the ignorance; they sum to 1.
"""

import numpy as np
import numpy.typing as npt

from omninav.stages.geometry.arrays import Array

SUPPORT, UNKNOWN = 0, 2
"""Columns of masses: Spt(H) = m(H) (equation 7), and the ignorance."""
SUREST = 0.99
"""The most that evidence may weigh: two certain opposites could not be combined (erratum 29 in docs/papers.md)."""


def masses(similarity: npt.ArrayLike, confidence: npt.ArrayLike) -> Array:
    """Masses of a similarity in [0, 1] with a confidence in [0, 1]: (..., 3).

    m(H) = s xi, m(not H) = (1 - s) xi, m(H or not H) = 1 - xi (Goedeme et al. 2007, equation 9 as erratum 29 reads it).
    Confidence is capped below 1.
    """
    s = np.clip(np.asarray(similarity, np.float64), 0.0, 1.0)
    sure = np.clip(np.asarray(confidence, np.float64), 0.0, SUREST)
    return np.stack(np.broadcast_arrays(s * sure, (1.0 - s) * sure, 1.0 - sure), axis=-1)


def confidence(distance: npt.ArrayLike, reach: float) -> Array:
    """Weight of a neighbour's evidence: xi = 1 - sin(pi d / (2 reach)), 0 beyond the reach.

    Equation 8, called an ignorance function there: ignorance is 1 - xi (erratum 29). `distance` and
    `reach` are in any one unit.
    """
    d = np.asarray(distance, np.float64)
    within: Array = 1.0 - np.sin(np.pi * np.minimum(d, reach) / (2.0 * reach))
    return np.where(d <= reach, within, 0.0)


def combine(one: Array, other: Array) -> Array:
    """Dempster's rule: both sources together (equation 6; erratum 31: the denominator is 1 less the conflict).

    `one`, `other` (..., 3). Order does not matter. Raises ValueError where they contradict each other entirely.
    """
    yes = one[..., 0] * (other[..., 0] + other[..., 2]) + one[..., 2] * other[..., 0]
    no = one[..., 1] * (other[..., 1] + other[..., 2]) + one[..., 2] * other[..., 1]
    open_ = one[..., 2] * other[..., 2]
    total = yes + no + open_
    if not (total > 0.0).all():
        raise ValueError("two sources of evidence that contradict each other entirely cannot be combined")
    return np.stack([yes, no, open_], axis=-1) / total[..., None]


def similarity_of(distance: npt.ArrayLike, spread: float, form: str = "ratio") -> Array:
    """A visual distance as a similarity in [0, 1], which may be a mass (erratum 28).

    `ratio`: 1 / (1 + D / spread); `gaussian`: exp(-D^2 / (2 spread^2)). The paper's
    own, the inverse of D over a standard deviation, has no bound. An infinite distance is a similarity of 0.
    """
    scaled = np.asarray(distance, np.float64) / spread
    with np.errstate(over="ignore"):
        if form == "gaussian":
            return np.exp(-0.5 * scaled * scaled)
        return 1.0 / (1.0 + scaled)


def gather(initial: Array, distances: Array, reach: float) -> Array:
    """Each hypothesis together with its neighbours' evidence, in one pass: (H, 3).

    `initial` (H, 3): masses before. `distances` (H, H): between hypotheses; a neighbour is one nearer than `reach`. A
    neighbour's own similarity, that of its *initial* masses, counts with confidence xi of the distance: updated masses
    fed back would count evidence twice (erratum 31).
    """
    sure = initial[:, 0] + initial[:, 1]
    similarity = np.divide(initial[:, 0], sure, out=np.zeros_like(sure), where=sure > 0.0)
    told = initial.copy()
    weights = confidence(distances, reach)
    for row in range(len(initial)):
        for neighbour in np.flatnonzero((weights[row] > 0.0) & (np.arange(len(initial)) != row)):
            told[row] = combine(told[row], masses(similarity[neighbour], weights[row, neighbour]))
    return told

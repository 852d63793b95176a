"""Consistency of an estimate with the places that images look like."""

import numpy as np

from omninav.stages.geometry.arrays import Array
from omninav.stages.geometry.plane.se2 import wrap


def consistency(places: Array, pose: Array, metres: float, radians: float) -> Array:
    """Agreement of places (N, 3) with a pose (3,), in [0, 1]: 1 well within these widths, 0 well beyond; (N,).

    exp(-d^4 / 2) of the distance d in widths: a Gaussian would take from places that agree as well as matches can.
    """
    away = places - pose
    squares = (np.square(away[:, 0]) + np.square(away[:, 1])) / metres**2
    share: Array = np.exp(-0.5 * np.square(squares + np.square(wrap(away[:, 2]) / radians)))
    return share


def goes_on(before: Array, pose: Array, metres: float, radians: float) -> bool:
    """Tells whether an estimate (3,) is where odometry leads the last one, `before` (3,)."""
    return bool(consistency(before[None], pose, metres, radians)[0] > 0.5)


def log_odds_of_right(
    agreeing: Array, disagreeing: Array, novelties: Array, when_wrong: float, strength: float, kidnapping: float
) -> float:
    """Log odds that an estimate is right, by which of the last images agree with it; (N,) each, the oldest first.

    `agreeing`, `disagreeing`: as how many images each one speaks for and against the estimate. While the
    estimate is right, the share of agreeing images is not known (light, people): uniform. While it is wrong, the
    share has a Beta distribution with mean `when_wrong`, as if known from `strength` images. Before each image
    the robot may have been carried elsewhere, so that an estimate that was right is wrong since, or the other way
    round, with a probability of `kidnapping` times the image's novelty. Likelihoods are Beta-binomial; more than one
    such change is not considered.
    """
    from scipy.special import betaln  # slow to import: not before a run

    if not len(agreeing):
        return 0.0
    agree, other = np.zeros(len(agreeing) + 1), np.zeros(len(agreeing) + 1)
    agreeing.cumsum(out=agree[1:])
    disagreeing.cumsum(out=other[1:])
    left, right = agree[-1] - agree, other[-1] - other
    a, b = when_wrong * strength, (1.0 - when_wrong) * strength
    ever, never = betaln(1.0, 1.0), betaln(a, b)
    right_before, wrong_before = betaln(1.0 + agree, 1.0 + other) - ever, betaln(a + agree, b + other) - never
    right_since, wrong_since = betaln(1.0 + left, 1.0 + right) - ever, betaln(a + left, b + right) - never
    # The last of each stayed as it is; that is put in place of the first, which nothing precedes.
    change = np.log(np.maximum(kidnapping * novelties[1:], 1e-300))
    recovered, kidnapped = wrong_before[:-1] + right_since[:-1], right_before[:-1] + wrong_since[:-1]
    recovered[1:] += change
    kidnapped[1:] += change
    recovered[0], kidnapped[0] = right_before[-1], wrong_before[-1]
    return float(np.logaddexp.reduce(recovered) - np.logaddexp.reduce(kidnapped))

"""Consistency of an estimate with the places that images look like."""

import numpy as np
import numpy.typing as npt

from omninav.stages.geometry.plane.se2 import wrap

Array = npt.NDArray[np.float64]


def consistency(places: Array, pose: Array, metres: float, radians: float) -> Array:
    """Agreement of places (N, 3) with a pose (3,), in [0, 1]: 1 well within these widths, 0 well beyond; (N,).

    exp(-d^4 / 2) of the distance d in widths: a Gaussian would take from places that agree as well as matches can.
    """
    squares = (np.square(places[:, :2] - pose[:2]).sum(axis=1)) / metres**2
    share: Array = np.exp(-0.5 * np.square(squares + np.square(wrap(places[:, 2] - pose[2]) / radians)))
    return share


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
    agree, other = (np.concatenate([[0.0], np.cumsum(counts)]) for counts in (agreeing, disagreeing))
    right, wrong = (1.0, 1.0), (when_wrong * strength, (1.0 - when_wrong) * strength)
    before = [_log_likelihood(agree, other, prior) for prior in (right, wrong)]
    since = [_log_likelihood(agree[-1] - agree, other[-1] - other, prior) for prior in (right, wrong)]
    change = np.log(np.maximum(kidnapping * novelties[1:], 1e-300))
    inner = slice(1, len(agree) - 1)
    stayed_right, stayed_wrong = before[0][-1], before[1][-1]
    recovered, kidnapped = before[1][inner] + since[0][inner] + change, before[0][inner] + since[1][inner] + change
    return float(np.logaddexp.reduce([stayed_right, *recovered]) - np.logaddexp.reduce([stayed_wrong, *kidnapped]))


def _log_likelihood(agree: Array, other: Array, prior: tuple[float, float]) -> Array:
    from scipy.special import betaln  # slow to import: not before a run

    found: Array = betaln(prior[0] + agree, prior[1] + other) - betaln(*prior)
    return found

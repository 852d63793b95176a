"""Likelihood ratios of two hypotheses from a score, learned on examples of both."""

import math

import numpy as np

from omninav.stages.geometry.arrays import Array, Bools, Floats

from .evidence import MIN_SPREAD, best_headings, centre_and_spread

RIDGE = 1e-3
"""Ridge of the logistic regression: it holds the slope finite where a score separates all examples."""
MAX_LOG_ODDS = 30.0
"""Logarithm of the largest ratio, so that none is infinite."""
MIN_SIMILARITY = 1e-6
"""Similarity below which all are alike, so that its logarithm is finite."""
TAIL = 0.4
"""Share of the slope that is left above the largest ratio that the examples show."""


def standard_scores(similarity: Floats, sampling_weight: Array | None = None) -> Floats:
    """log S in standard deviations from its mean over the references at their best headings: (R, headings) float32.

    `sampling_weight` (R,): how many references of the map each represents; None: one each.
    """
    logarithms = np.log(np.maximum(similarity, np.float32(MIN_SIMILARITY)))
    centre, spread = centre_and_spread(best_headings(logarithms)[0], sampling_weight)
    return (logarithms - np.float32(centre)) * np.float32(1.0 / max(spread, MIN_SPREAD))


def standard_score(similarity: float, best: Floats, sampling_weight: Array | None = None) -> float:
    """Standardises one more similarity as `standard_scores` does, given the references' at their best headings (R,)."""
    centre, spread = centre_and_spread(np.log(np.maximum(best, np.float32(MIN_SIMILARITY))), sampling_weight)
    return (math.log(max(similarity, MIN_SIMILARITY)) - centre) / max(spread, MIN_SPREAD)


def logistic_fit(scores: Array, weights: Array, right: Bools) -> tuple[float, float]:
    """Slope and middle of the log odds of `right` over scores (N,), each counted by its weight (N,).

    Where both kinds weigh the same in all, slope (z - middle) is the log of the likelihood ratio. The slope is never
    below 0.
    """
    design = np.column_stack([np.ones_like(scores), scores])
    found, reached = np.zeros(2), set[bytes]()
    for _ in range(50):  # Newton's method, with steps that cannot leap over the optimum of separable examples
        odds = 1.0 / (1.0 + np.exp(-np.clip(design @ found, -MAX_LOG_ODDS, MAX_LOG_ODDS)))
        gradient = design.T @ (weights * (right - odds)) - RIDGE * found
        curvature = (design * (weights * odds * (1.0 - odds))[:, None]).T @ design + RIDGE * np.eye(2)
        step = np.linalg.solve(curvature, gradient)
        found = found + step * min(1.0, 3.0 / max(float(np.abs(step).max()), 1e-12))
        if found.tobytes() in reached:  # only rounding is left
            break
        reached.add(found.tobytes())
    if found[1] <= 1e-6:
        return 0.0, 0.0
    return float(found[1]), float(-found[0] / found[1])


def ratios_of(scores: Floats, slope: float, middle: float) -> Floats:
    """The likelihood ratio of each score: exp(slope (z - middle))."""
    return np.asarray(np.exp(np.clip(np.float32(slope) * (scores - np.float32(middle)), -MAX_LOG_ODDS, MAX_LOG_ODDS)))


def saturated_ratios(scores: Floats, slope: float, middle: float, outliers: float, images: int) -> Floats:
    """The likelihood ratio r = exp(slope (z - middle)), saturated: (e + (1 - e) r) / (1 + (r / n)^(1 - `TAIL`)).

    With a share of `outliers` e the right place looks like any other: the ratio is never below e. The n `images` that
    it was learned on show nothing rarer than one among them: above n it grows with a `TAIL` of the slope only, by which
    the nearest of several right references still stands out.
    """
    odds = ratios_of(scores, slope, middle)
    above = np.power(odds / np.float32(images), np.float32(1.0 - TAIL))
    return np.asarray((np.float32(outliers) + np.float32(1.0 - outliers) * odds) / (np.float32(1) + above))


def correlation_length(values: Array, places: Array, compared: Bools | None = None) -> float | None:
    """The distance l of exp(-d / l) that fits the products of standardised values (N,) at `places` (N, 2) best.

    Of all pairs at different places, or of those `compared` (N, N). None where there are too few, or all values are
    equal.
    """
    spread = float(values.std())
    gaps = np.hypot(*(places[:, None] - places).transpose(2, 0, 1))
    pairs = np.triu(gaps > 1e-6) if compared is None else np.triu(gaps > 1e-6) & compared
    if spread < 1e-9 or pairs.sum() < 10:
        return None
    standard = (values - values.mean()) / spread
    far, products = gaps[pairs], np.multiply.outer(standard, standard)[pairs]
    lengths = np.geomspace(float(np.quantile(far, 0.0005)), float(far.max()), 60)
    misfits = [float(np.square(products - np.exp(-far / length)).sum()) for length in lengths]
    return float(lengths[int(np.argmin(misfits))])

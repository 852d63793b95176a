"""Gaussians over poses (x, y, heading) and mixtures of them: densities, distances, moments, merging, intersection.

Arrays are float64: means (K, 3) in m, m, rad, covariances (K, 3, 3), weights (K,). A difference of headings is always
the shorter turn, in [-pi, pi): a heading's spread is taken to be well below half a turn.
"""

import math

import numpy as np
import numpy.typing as npt

from omninav.pipeline.engine.compiled import compiled
from omninav.stages.geometry.arrays import Array, Bools, Ints
from omninav.stages.geometry.plane.se2 import wrap

MAX_SQUARED_DISTANCE = 81.0
"""Nine sigma: beyond this a Gaussian's density counts as 0, less than 3e-18 of its peak."""

MIN_VARIANCE = 1e-300
"""Replaces a variance of zero, so that equal poses are at distance 0 and others far away."""


def density(points: Array, means: Array, covariances: Array, weights: Array) -> Array:
    """Weighted sum of normalised Gaussians at points (N, 3): (N,) in 1/(m^2 rad) (Porta & Kroese 2004, equation 5).

    Each Gaussian counts with the shorter turn only, so that it sums to 1 over all headings as long as its heading's
    sigma is well below pi (0.998 at 1 rad), and within nine sigma. Raises ValueError where a covariance is not
    positive definite.
    """
    if not len(means) or not len(points):
        return np.zeros(len(points))
    factors = _triangular(covariances)
    low, high = points[:, :2].min(axis=0), points[:, :2].max(axis=0)
    reach = np.sqrt(MAX_SQUARED_DISTANCE * np.diagonal(covariances, axis1=1, axis2=2)[:, :2])
    near = np.flatnonzero(((means[:, :2] + reach >= low) & (means[:, :2] - reach <= high)).all(axis=1))
    means, weights = means[near], weights[near]
    factors = np.asarray(np.linalg.inv(factors[near]), np.float64)
    scales = weights * np.abs(np.prod(np.diagonal(factors, axis1=1, axis2=2), axis=1)) / (2.0 * math.pi) ** 1.5
    return _density(np.ascontiguousarray(points, np.float64), np.ascontiguousarray(means, np.float64), factors, scales)


def squared_distances(mean_a: Array, cov_a: Array, mean_b: Array, cov_b: Array) -> Array:
    """Squared Mahalanobis distances d^T (C_a + C_b)^-1 d between means (A, 3) and (B, 3): (A, B).

    Gross, Koenig & Mueller 2005, equations 2, 12 and 15, with the transpose that equation 2 lost and the heading's
    difference wrapped (erratum 1 in docs/papers.md). For equal poses with three degrees of freedom 95 % are below 7.81.
    """
    return _squared_distances(*(np.ascontiguousarray(a, np.float64) for a in (mean_a, cov_a, mean_b, cov_b)))


def moments(means: Array, covariances: Array, weights: Array) -> tuple[Array, Array, float]:
    """Mean (3,), covariance (3, 3) and summed weight of a mixture; the heading's mean is circular.

    Gross, Koenig & Mueller 2005, equations 13 and 14, divided by the sum of weights (erratum 7). Where all weights are
    0 all count the same.
    """
    total = float(weights.sum())
    share = weights / total if total > 0.0 else np.full(len(weights), 1.0 / len(weights))
    mean = share @ means
    mean[2] = math.atan2(share @ np.sin(means[:, 2]), share @ np.cos(means[:, 2]))
    covariance = np.einsum("k,kij->ij", share, covariances)
    apart = means - mean
    apart[:, 2] = wrap(apart[:, 2])
    covariance = covariance + np.einsum("k,ki,kj->ij", share, apart, apart)
    return mean, 0.5 * (covariance + covariance.T), total


def merged(
    means: Array,
    covariances: Array,
    weights: Array,
    merge_below: float,
    spread: bool = True,
    shares: Array | None = None,
) -> tuple[Array, ...]:
    """Gaussians with the close ones merged: the closest pair first, until no pair is closer than `merge_below`.

    `merge_below` is a squared Mahalanobis distance (`squared_distances`); a pair becomes one Gaussian with its
    `moments`; without `spread` its covariance is the mean of theirs (Porta & Kroese 2004, section 3.2), which is
    over-confident (erratum 16). `weights`: how much each counts in them and are added up; `shares` (K,)
    are added up only. Porta & Kroese 2004, section 3.2: the weights are w. Gross, Koenig & Mueller 2005, equations 12
    to 14 (erratum 7): the weights are eta and the shares w, which may come to more than 1 (erratum 8: cap them).

    Returns means, covariances, weights, and shares where given. Components come in an order of their own, by weight
    and then by the rest, so that neither the result nor its order depends on the order of the input. A set that merges
    to one has the same moments in x and y in any order; the heading's circular mean of three depends on which pair
    goes first, by as much as they are spread.
    """
    size = len(weights)
    means = np.ascontiguousarray(means, np.float64).reshape(size, 3)
    covariances = np.ascontiguousarray(covariances, np.float64).reshape(size, 3, 3)
    added = np.zeros(size) if shares is None else np.asarray(shares, np.float64)
    order = np.lexsort((*covariances.reshape(size, 9).T, added, *means.T[::-1], -np.asarray(weights)))
    rows = (means[order], covariances[order], np.asarray(weights, np.float64)[order], added[order])
    if size > 1 and merge_below > 0.0:
        kept = _merge(*rows, float(merge_below), spread)
        rows = (rows[0][kept], rows[1][kept], rows[2][kept], rows[3][kept])
    return rows if shares is not None else rows[:3]


def intersected(mean_a: Array, cov_a: Array, mean_b: Array, cov_b: Array, alpha: float) -> tuple[Array, Array]:
    """Covariance intersection of two Gaussians: mean (3,) and covariance (3, 3).

    C = ((1 - alpha) C_a^-1 + alpha C_b^-1)^-1, mu = C [(1 - alpha) C_a^-1 mu_a + alpha C_b^-1 mu_b'] with mu_b' = mu_a
    + wrap(mu_b - mu_a) (Gross, Koenig & Mueller 2005, equations 3 and 4; the inverses of equation 3 were lost in
    print, erratum 2). It does not shrink where both are the same: equal covariances stay as they are (erratum 4).
    Raises ValueError where a covariance is not positive definite.
    """
    mean, covariance = np.empty(3), np.empty((3, 3))
    a, c_a, b, c_b = (np.ascontiguousarray(each, np.float64) for each in (mean_a, cov_a, mean_b, cov_b))
    if not intersect_into(a, c_a, b, c_b, alpha, mean, covariance):
        raise ValueError("a covariance is not positive definite")
    return mean, covariance


def drawn(means: Array, covariances: Array, weights: Array, number: int, rng: np.random.Generator) -> Array:
    """Poses (number, 3) drawn from a mixture, each component by its weight. Raises ValueError without any weight."""
    upto = np.cumsum(weights)
    if not len(upto) or not upto[-1] > 0.0:
        raise ValueError("a mixture without weight has no poses to draw")
    chosen = np.searchsorted(upto, rng.random(number) * upto[-1], side="right")
    chosen = np.minimum(chosen, np.flatnonzero(weights > 0.0)[-1])  # rounding must not end on one without weight
    poses: Array = means[chosen] + np.einsum(
        "nij,nj->ni", _triangular(covariances)[chosen], rng.standard_normal((number, 3))
    )
    poses[:, 2] = wrap(poses[:, 2])
    return poses


def floored(covariance: Array, least: npt.ArrayLike) -> Array:
    """Covariances (..., 3, 3) made symmetric and no smaller in any direction than that of sigmas `least` (3,).

    Eigenvalues are raised to at least 1 with x, y, heading in units of `least` (m, m, rad): what is above the floor
    already stays as it is.
    """
    sigmas = np.asarray(least, np.float64)
    units = np.multiply.outer(sigmas, sigmas)
    covariance = 0.5 * (covariance + np.swapaxes(covariance, -1, -2))
    values, vectors = np.linalg.eigh(covariance / units)
    low = values[..., 0] < 1.0
    if not low.any():
        return covariance
    raised = np.einsum("...ik,...k,...jk->...ij", vectors, np.maximum(values, 1.0), vectors) * units
    return np.where(low[..., None, None], 0.5 * (raised + np.swapaxes(raised, -1, -2)), covariance)


def _triangular(covariances: Array) -> Array:
    try:
        factors = np.linalg.cholesky(covariances)
    except np.linalg.LinAlgError:
        raise ValueError("a covariance is not positive definite") from None
    return np.asarray(factors, np.float64)


@compiled(nogil=True, inline="always")
def shorter_turn(angle: float) -> float:
    """An angle brought into [-pi, pi)."""
    return float(angle - 2.0 * np.pi * np.floor((angle + np.pi) / (2.0 * np.pi)))


@compiled(nogil=True, error_model="numpy")
def _density(points: Array, means: Array, factors: Array, scales: Array) -> Array:
    # Distances first, in a loop without a branch: the compiler then takes several points at a time.
    number = len(points)
    x, y, heading = points[:, 0].copy(), points[:, 1].copy(), points[:, 2].copy()
    squared, out = np.empty(number), np.zeros(number)
    for k in range(len(means)):
        mean_x, mean_y, mean_heading = means[k, 0], means[k, 1], means[k, 2]
        xx, yx, yy = factors[k, 0, 0], factors[k, 1, 0], factors[k, 1, 1]
        hx, hy, hh = factors[k, 2, 0], factors[k, 2, 1], factors[k, 2, 2]
        for n in range(number):
            dx, dy, turn = x[n] - mean_x, y[n] - mean_y, shorter_turn(heading[n] - mean_heading)
            a, b, c = xx * dx, yx * dx + yy * dy, hx * dx + hy * dy + hh * turn
            squared[n] = a * a + b * b + c * c
        for n in range(number):
            if squared[n] <= MAX_SQUARED_DISTANCE:
                out[n] += scales[k] * np.exp(-0.5 * squared[n])
    return out


@compiled(nogil=True, error_model="numpy")
def squared_distance(mean_a: Array, cov_a: Array, mean_b: Array, cov_b: Array) -> float:
    """Squared Mahalanobis distance between two means with C_a + C_b, by its Cholesky factor."""
    dx, dy, turn = mean_b[0] - mean_a[0], mean_b[1] - mean_a[1], shorter_turn(mean_b[2] - mean_a[2])
    first = max(cov_a[0, 0] + cov_b[0, 0], MIN_VARIANCE)
    low1 = (cov_a[1, 0] + cov_b[1, 0]) / first
    low2 = (cov_a[2, 0] + cov_b[2, 0]) / first
    second = max(cov_a[1, 1] + cov_b[1, 1] - low1 * low1 * first, MIN_VARIANCE)
    low3 = (cov_a[2, 1] + cov_b[2, 1] - low2 * low1 * first) / second
    third = max(cov_a[2, 2] + cov_b[2, 2] - low2 * low2 * first - low3 * low3 * second, MIN_VARIANCE)
    rest1 = dy - low1 * dx
    rest2 = turn - low2 * dx - low3 * rest1
    return float(dx * dx / first + rest1 * rest1 / second + rest2 * rest2 / third)


@compiled(nogil=True)
def _squared_distances(mean_a: Array, cov_a: Array, mean_b: Array, cov_b: Array) -> Array:
    out = np.empty((len(mean_a), len(mean_b)))
    for a in range(len(mean_a)):
        for b in range(len(mean_b)):
            out[a, b] = squared_distance(mean_a[a], cov_a[a], mean_b[b], cov_b[b])
    return out


@compiled(nogil=True)
def farther_apart(mean_a: Array, cov_a: Array, mean_b: Array, cov_b: Array, limit: float) -> bool:
    """Tells if x, y or heading alone puts the squared distance at `limit` or more: a cheap test for most pairs."""
    for i in range(3):
        gap = mean_b[i] - mean_a[i]
        if i == 2:
            gap = shorter_turn(gap)
        if gap * gap >= limit * (cov_a[i, i] + cov_b[i, i]) and gap != 0.0:
            return True
    return False


@compiled(nogil=True, error_model="numpy")
def _nearest(i: int, means: Array, covariances: Array, alive: Bools, limit: float) -> tuple[int, float]:
    best, closest = -1, limit
    for j in range(i + 1, len(means)):
        if alive[j] and not farther_apart(means[i], covariances[i], means[j], covariances[j], closest):
            squared = squared_distance(means[i], covariances[i], means[j], covariances[j])
            if squared < closest:
                best, closest = j, squared
    return best, closest


@compiled(nogil=True, error_model="numpy")
def _merge(means: Array, covariances: Array, weights: Array, shares: Array, limit: float, spread: bool) -> Ints:
    # Works in place. Each row knows its nearest later one; a row whose nearest has changed keeps its distance as a
    # bound from below until it is looked at, so that most merges cost one pass.
    size = len(means)
    alive = np.ones(size, np.bool_)
    stale = np.zeros(size, np.bool_)
    nearest = np.empty(size, np.int64)
    closest = np.empty(size)
    for i in range(size):
        nearest[i], closest[i] = _nearest(i, means, covariances, alive, limit)
    while True:
        a = -1
        for i in range(size):
            if alive[i] and nearest[i] >= 0 and (a < 0 or closest[i] < closest[a]):
                a = i
        if a < 0:
            break
        if stale[a]:
            nearest[a], closest[a] = _nearest(a, means, covariances, alive, limit)
            stale[a] = False
            continue
        b = nearest[a]
        _merge_pair(means, covariances, weights, shares, a, b, spread)
        alive[b] = False
        nearest[a], closest[a] = _nearest(a, means, covariances, alive, limit)
        for i in range(b):
            if not alive[i] or i == a:
                continue
            if nearest[i] == a or nearest[i] == b:
                stale[i] = True
            if i < a and not farther_apart(means[i], covariances[i], means[a], covariances[a], limit):
                squared = squared_distance(means[i], covariances[i], means[a], covariances[a])
                if squared < limit and (nearest[i] < 0 or squared < closest[i]):
                    nearest[i], closest[i], stale[i] = a, squared, False
    return np.flatnonzero(alive)


@compiled(nogil=True, error_model="numpy")
def _merge_pair(means: Array, covariances: Array, weights: Array, shares: Array, a: int, b: int, spread: bool) -> None:
    total = weights[a] + weights[b]
    share = weights[b] / total if total > 0.0 else 0.5
    gap = means[b] - means[a]
    gap[2] = shorter_turn(gap[2])
    sine = (1.0 - share) * np.sin(means[a, 2]) + share * np.sin(means[b, 2])
    cosine = (1.0 - share) * np.cos(means[a, 2]) + share * np.cos(means[b, 2])
    turn = shorter_turn(np.arctan2(sine, cosine) - means[a, 2])
    from_a = share * gap
    from_a[2] = turn
    from_b = from_a - gap
    from_b[2] = shorter_turn(from_b[2])
    for i in range(3):
        for j in range(i + 1):
            value = (1.0 - share) * covariances[a, i, j] + share * covariances[b, i, j]
            if spread:
                value += (1.0 - share) * from_a[i] * from_a[j] + share * from_b[i] * from_b[j]
            covariances[a, i, j] = covariances[a, j, i] = value
        means[a, i] += from_a[i]
    means[a, 2] = shorter_turn(means[a, 2])
    weights[a] = total
    shares[a] += shares[b]


@compiled(nogil=True, error_model="numpy")
def inverse_into(matrix: Array, out: Array) -> float:
    """The inverse of a positive definite matrix (3, 3) into `out`, and the logarithm of its determinant.

    By its Cholesky factor, so that the inverse is symmetric and positive definite too. NaN where it is not positive
    definite; `out` is then of no meaning.
    """
    a = np.sqrt(matrix[0, 0])
    b = matrix[1, 0] / a
    c = np.sqrt(matrix[1, 1] - b * b)
    d = matrix[2, 0] / a
    e = (matrix[2, 1] - d * b) / c
    f = np.sqrt(matrix[2, 2] - d * d - e * e)
    if not (a > 0.0 and c > 0.0 and f > 0.0):
        return np.nan
    a, c, f = 1.0 / a, 1.0 / c, 1.0 / f
    g = -b * a * c
    h = -e * c * f
    k = -(d * a + e * g) * f
    out[0, 0], out[1, 1], out[2, 2] = a * a + g * g + k * k, c * c + h * h, f * f
    out[0, 1] = out[1, 0] = g * c + k * h
    out[0, 2] = out[2, 0] = k * f
    out[1, 2] = out[2, 1] = h * f
    return float(-2.0 * (np.log(a) + np.log(c) + np.log(f)))


@compiled(nogil=True, error_model="numpy")
def intersect_into(
    mean_a: Array, cov_a: Array, mean_b: Array, cov_b: Array, alpha: float, mean: Array, covariance: Array
) -> bool:
    """Writes what `intersected` gives into `mean` and `covariance`; False where one is not positive definite."""
    information, other = np.empty((3, 3)), np.empty((3, 3))
    if np.isnan(inverse_into(cov_a, information)) or np.isnan(inverse_into(cov_b, other)):
        return False
    gap = mean_b - mean_a
    gap[2] = shorter_turn(gap[2])
    pull = np.empty(3)
    for i in range(3):
        # C [(1 - alpha) C_a^-1 mu_a + alpha C_b^-1 (mu_a + gap)] = mu_a + C alpha C_b^-1 gap
        pull[i] = alpha * (other[i, 0] * gap[0] + other[i, 1] * gap[1] + other[i, 2] * gap[2])
        for j in range(3):
            information[i, j] = (1.0 - alpha) * information[i, j] + alpha * other[i, j]
    if np.isnan(inverse_into(information, covariance)):
        return False
    for i in range(3):
        mean[i] = mean_a[i] + covariance[i, 0] * pull[0] + covariance[i, 1] * pull[1] + covariance[i, 2] * pull[2]
    mean[2] = shorter_turn(mean[2])
    return True

"""Fuses mixtures from several sources into one belief by weighted covariance intersection."""

import numpy as np

from omninav.pipeline import Context, Outputs, Stage
from omninav.pipeline.engine.compiled import compiled
from omninav.stages.geometry.arrays import Array
from omninav.stages.geometry.probability.gaussians import (
    farther_apart,
    intersect_into,
    inverse_into,
    merged,
    squared_distance,
)
from omninav.stages.values.belief import GaussianMixture

MAX_DISTANCE = 7.81
"""Squared Mahalanobis distance below which two components correspond: 95 % with 3 degrees of freedom."""
MERGE_BELOW = 2.0
"""Squared Mahalanobis distance below which components of the result are merged: two equal Gaussians closer than 2 (two
sigma) have a single peak."""
DROP_BELOW = 0.01
"""Share of the heaviest component's weight below which components are dropped."""
MAX_COMPONENTS = 200
"""Components that stay, the heaviest, which bounds the work."""


def alpha_of_min_determinant(cov_a: Array, cov_b: Array) -> float:
    """The weight alpha of b at which the intersection has the smallest determinant.

    Julier & Uhlmann 1997; erratum 3.
    """
    inverse = np.empty((3, 3))
    inverse_into(np.ascontiguousarray(cov_b, np.float64), inverse)
    return float(_min_determinant(np.ascontiguousarray(cov_a, np.float64), inverse))


def fuse(
    a: tuple[Array, Array, Array], b: tuple[Array, Array, Array], gamma: float, weighted: bool = True
) -> tuple[Array, Array, Array]:
    """Fuse two mixtures (means, covariances, weights > 0); the result's weights sum to those of both.

    Gross, Koenig & Mueller 2005, section 2.1: components whose squared Mahalanobis distance is below `gamma`
    (equation 2, erratum 1) are intersected pairwise (equations 3 and 4, erratum 2), with weight
    w_a w_b / sum of the w_b that match a + w_b w_a / sum of the w_a that match b (equations 6 to 8); unmatched
    components are copied. So the sum of all weights is that of both mixtures (erratum 5); normalise only after the last
    source. Raises ValueError where a covariance is not positive definite.
    """
    mean_a, cov_a, weight_a, mean_b, cov_b, weight_b = (np.ascontiguousarray(each, np.float64) for each in (*a, *b))
    means, covariances, weights, definite = _fuse(mean_a, cov_a, weight_a, mean_b, cov_b, weight_b, gamma, weighted)
    if not definite:
        raise ValueError("a covariance is not positive definite")
    return means, covariances, weights


@compiled(nogil=True, error_model="numpy")
def alpha_by_ratio(log_det_a: float, log_det_b: float, weight_a: float, weight_b: float) -> float:
    """The weight alpha of b: w_b det(C_a) / (w_b det(C_a) + w_a det(C_b)).

    Gross, Koenig & Mueller 2005, equation 5; with equal weights the form of Porta & Kroese. A heuristic: it does not
    minimise the result's determinant, and saturates (covariances 1 : 4 in three dimensions give 1 : 64; erratum 3 in
    docs/papers.md).
    """
    alpha: float = 1.0 / (1.0 + weight_a / weight_b * np.exp(log_det_b - log_det_a))
    return alpha


@compiled(nogil=True, error_model="numpy")
def _min_determinant(cov_a: Array, inverse_b: Array) -> float:
    # det(C^-1) over det(C_a^-1) is det(I + alpha E) with E = C_a C_b^-1 - I: a cubic in alpha, log-concave where C_a
    # and C_b are positive definite. Its slope's sign is followed to the one maximum in [0, 1].
    e = cov_a @ inverse_b
    for i in range(3):
        e[i, i] -= 1.0
    linear = e[0, 0] + e[1, 1] + e[2, 2]
    square = (
        e[0, 0] * e[1, 1] - e[0, 1] * e[1, 0]
        + e[0, 0] * e[2, 2] - e[0, 2] * e[2, 0]
        + e[1, 1] * e[2, 2] - e[1, 2] * e[2, 1]
    )  # fmt: skip
    cube = (
        e[0, 0] * (e[1, 1] * e[2, 2] - e[1, 2] * e[2, 1])
        - e[0, 1] * (e[1, 0] * e[2, 2] - e[1, 2] * e[2, 0])
        + e[0, 2] * (e[1, 0] * e[2, 1] - e[1, 1] * e[2, 0])
    )
    if abs(linear) + abs(square) < 1e-12:
        return 0.5  # equal covariances: any alpha is as good
    low, high = 0.0, 1.0
    for _ in range(60):
        alpha = 0.5 * (low + high)
        if linear + alpha * (2.0 * square + alpha * 3.0 * cube) > 0.0:
            low = alpha
        else:
            high = alpha
    return 0.5 * (low + high)


@compiled(nogil=True, error_model="numpy")
def _fuse(
    mean_a: Array,
    cov_a: Array,
    weight_a: Array,
    mean_b: Array,
    cov_b: Array,
    weight_b: Array,
    gamma: float,
    weighted: bool,
) -> tuple[Array, Array, Array, bool]:
    size_a, size_b = len(weight_a), len(weight_b)
    match = np.zeros((size_a, size_b), np.bool_)
    matched_a, matched_b = np.zeros(size_a), np.zeros(size_b)
    unmatched_a, unmatched_b = np.ones(size_a, np.bool_), np.ones(size_b, np.bool_)
    number = 0
    for i in range(size_a):
        for j in range(size_b):
            if farther_apart(mean_a[i], cov_a[i], mean_b[j], cov_b[j], gamma):
                continue
            if squared_distance(mean_a[i], cov_a[i], mean_b[j], cov_b[j]) < gamma:
                match[i, j] = True
                matched_a[i] += weight_b[j]
                matched_b[j] += weight_a[i]
                unmatched_a[i] = unmatched_b[j] = False
                number += 1
    size = number + unmatched_a.sum() + unmatched_b.sum()
    means, covariances, weights = np.empty((size, 3)), np.empty((size, 3, 3)), np.empty(size)
    inverse = np.empty((3, 3))
    log_det_a, log_det_b = np.empty(size_a), np.empty(size_b)
    for i in range(size_a):
        log_det_a[i] = inverse_into(cov_a[i], inverse)
    for j in range(size_b):
        log_det_b[j] = inverse_into(cov_b[j], inverse)
    definite = not (np.isnan(log_det_a).any() or np.isnan(log_det_b).any())
    at = 0
    for i in range(size_a):
        if unmatched_a[i]:
            means[at], covariances[at], weights[at] = mean_a[i], cov_a[i], weight_a[i]
            at += 1
        for j in range(size_b):
            if not match[i, j]:
                continue
            share_a, share_b = (weight_a[i], weight_b[j]) if weighted else (1.0, 1.0)
            alpha = alpha_by_ratio(log_det_a[i], log_det_b[j], share_a, share_b)
            definite &= intersect_into(mean_a[i], cov_a[i], mean_b[j], cov_b[j], alpha, means[at], covariances[at])
            weights[at] = weight_a[i] * weight_b[j] * (1.0 / matched_a[i] + 1.0 / matched_b[j])
            at += 1
    for j in range(size_b):
        if unmatched_b[j]:
            means[at], covariances[at], weights[at] = mean_b[j], cov_b[j], weight_b[j]
            at += 1
    return means, covariances, weights, definite


class CovarianceIntersection(Stage):
    """Fuses prediction and hypotheses by covariance intersection; normalises once, after the last source.

    Gross, Koenig & Mueller 2005, section 2.1, with errata 1 to 5: see `fuse`. The sources are fused in the order of the
    ports, each with its own sum of weights. Then the weights are normalised, so that components without support fade,
    close components are merged (closest first, with the spread of their means), light ones are dropped, and at most
    `MAX_COMPONENTS` stay. Covariances do not shrink where sources agree (erratum 4).
    """

    weighted: bool = True
    """The second covariance's weight alpha, the ratio of determinants, takes the components' weights into account
    (Gross, Koenig & Mueller); false: it does not (Porta & Kroese)."""

    class Out(Outputs):
        """The belief after all sources; weights sum to 1."""

        belief: GaussianMixture

    def step(
        self,
        ctx: Context,
        prediction: GaussianMixture,
        hypothesis: GaussianMixture | None,
        fixes: GaussianMixture | None = None,
        other: GaussianMixture | None = None,
    ) -> Out:
        belief = _positive(prediction)
        for source in (hypothesis, fixes, other):
            if source is not None:
                belief = fuse(belief, _positive(source), MAX_DISTANCE, self.weighted)
        if not len(belief[2]):
            return self.Out(belief=prediction)
        return self.Out(belief=GaussianMixture(*self._simplified(*belief)))

    def _simplified(self, means: Array, covariances: Array, weights: Array) -> tuple[Array, Array, Array]:
        weights = weights / weights.sum()
        means, covariances, weights = merged(means, covariances, weights, MERGE_BELOW)
        kept = np.flatnonzero(weights >= DROP_BELOW * float(weights.max()))
        if len(kept) > MAX_COMPONENTS:
            kept = kept[np.sort(np.argsort(-weights[kept], kind="stable")[:MAX_COMPONENTS])]
        return means[kept], covariances[kept], weights[kept] / weights[kept].sum()


def _positive(mixture: GaussianMixture) -> tuple[Array, Array, Array]:
    kept = mixture.weights > 0.0
    return mixture.means[kept], mixture.covariances[kept], mixture.weights[kept]

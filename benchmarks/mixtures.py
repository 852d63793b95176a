"""Mixtures of Gaussians over poses: densities beside scipy's, and one step of covariance intersection."""

import numpy as np
from scipy.stats import multivariate_normal

from omninav.pipeline import Context
from omninav.stages.fusion.covariance_intersection import CovarianceIntersection, fuse
from omninav.stages.geometry.probability.gaussians import density, merged
from omninav.stages.motion.gaussian import GaussianMotion
from omninav.stages.sensor.superposition import Superposition
from omninav.stages.values.belief import GaussianMixture
from omninav.stages.values.pose import Motion
from omninav.stages.values.view_mixtures import ViewMixtures
from omninav.stages.values.views import Neighbours

from .table import Row, medians, milliseconds

PARTICLES, COMPONENTS = 5000, 200
VIEWS, PLACES, NEAR, BELIEVED = 2000, 4000, 50, 40
EXTENT = 10.0
"""Metres: the components' means lie in a square of that side."""


def rows() -> list[Row]:
    """Density of particles, and a step of the mixture filter without the image work."""
    return [_density(), *_step()]


def _mixture(rng: np.random.Generator, number: int) -> GaussianMixture:
    means = np.column_stack([rng.uniform(0, EXTENT, (number, 2)), rng.uniform(-np.pi, np.pi, number)])
    factors = rng.normal(size=(number, 3, 3)) * np.array([0.2, 0.2, 0.1])[:, None]
    covariances = factors @ np.swapaxes(factors, 1, 2) + np.diag([0.01, 0.01, 0.001])
    weights = rng.uniform(0.1, 1.0, number)
    return GaussianMixture(means, covariances, weights / weights.sum())


def _density() -> Row:
    rng = np.random.default_rng(0)
    mixture, points = _mixture(rng, COMPONENTS), _mixture(rng, PARTICLES).means

    def ours() -> np.ndarray:
        return density(points, mixture.means, mixture.covariances, mixture.weights)

    def scipys() -> np.ndarray:
        total = np.zeros(len(points))
        for mean, covariance, weight in zip(mixture.means, mixture.covariances, mixture.weights, strict=True):
            apart = points - mean
            apart[:, 2] -= 2 * np.pi * np.round(apart[:, 2] / (2 * np.pi))
            total += weight * multivariate_normal.pdf(apart, np.zeros(3), covariance)
        return total

    assert np.allclose(ours(), scipys(), atol=1e-12)
    taken = medians({"ours": ours, "scipy": scipys}, rounds=9)
    what = f"density of {PARTICLES} particles under {COMPONENTS} Gaussians"
    peer = "scipy multivariate_normal"
    return milliseconds(what, taken["ours"], peer, taken["scipy"], limit=1.0, of_peer=True)


def _step() -> list[Row]:
    rng = np.random.default_rng(1)
    map, neighbours = _map(rng), _neighbours(rng)
    belief, moved, ctx = _mixture(rng, BELIEVED), Motion(0.1, 0.0, 0.05), Context("mixtures", rng)
    motion, sensor, fusion = GaussianMotion(), Superposition(), CovarianceIntersection()
    hypothesis = sensor.step(ctx, neighbours, map).hypothesis
    assert hypothesis is not None
    a = (belief.means, belief.covariances, belief.weights)
    b = (hypothesis.means, hypothesis.covariances, hypothesis.weights)

    def step() -> None:
        predicted = motion.step(ctx, belief, moved).belief
        fusion.step(ctx, predicted, sensor.step(ctx, neighbours, map).hypothesis)

    crowded = _crowd(rng)
    taken = medians(
        {
            "step": step,
            "intersection": lambda: fusion.step(ctx, belief, hypothesis),
            "pairs": lambda: fuse(a, b, 7.81),
            "plainly": lambda: _fused_plainly(a, b, 7.81),
            "merging": lambda: merged(*crowded, 2.0),
        },
        rounds=15,
    )
    sizes = f"{BELIEVED} x {len(hypothesis)}"
    alone = f"covariance intersection {sizes}, pairs alone"
    return [
        milliseconds(f"mixture step: motion, superposition, intersection; {VIEWS} views", taken["step"], limit=5.0),
        milliseconds(f"covariance intersection {sizes}, merged", taken["intersection"], limit=5.0),
        milliseconds(alone, taken["pairs"], "numpy, pair by pair", taken["plainly"], limit=0.1, of_peer=True),
        milliseconds(f"merging {len(crowded[2])} Gaussians, the closest pair first", taken["merging"]),
    ]


def _map(rng: np.random.Generator) -> ViewMixtures:
    map, places = ViewMixtures.empty(), _mixture(rng, PLACES)
    for _ in range(VIEWS):
        map.add_view(np.zeros(8, np.float32), "Coefficients")
    for k, owner in enumerate(rng.permutation(np.arange(PLACES) % VIEWS).tolist()):
        map.add_component(owner, places.means[k], places.covariances[k], 0.5, 1.0)
    return map


def _neighbours(rng: np.random.Generator) -> Neighbours:
    alike = np.sort(rng.random(NEAR))[::-1]
    rows = rng.choice(VIEWS, NEAR, replace=False)
    return Neighbours(rows, 1.0 - alike, alike, rng.uniform(-np.pi, np.pi, NEAR), 0.1)


def _crowd(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A thousand Gaussians, of which many lie on one another."""
    mixture = _mixture(rng, 1000)
    return mixture.means, mixture.covariances, mixture.weights


def _fused_plainly(a: tuple[np.ndarray, ...], b: tuple[np.ndarray, ...], gamma: float) -> list[tuple[object, ...]]:
    # Equations 2 to 8 as they are written, with numpy's inverses; copies of what stands alone left out.
    (mean_a, cov_a, weight_a), (mean_b, cov_b, weight_b) = a, b
    apart = mean_b[None] - mean_a[:, None]
    apart[..., 2] -= 2 * np.pi * np.round(apart[..., 2] / (2 * np.pi))
    inverse = np.linalg.inv(cov_a[:, None] + cov_b[None])
    match = np.einsum("ijk,ijkl,ijl->ij", apart, inverse, apart) < gamma
    sum_a, sum_b = match @ weight_b, match.T @ weight_a
    out = []
    for i, j in np.argwhere(match):
        heavy_a, heavy_b = weight_a[i] * np.linalg.det(cov_b[j]), weight_b[j] * np.linalg.det(cov_a[i])
        alpha = heavy_b / (heavy_a + heavy_b)
        first, second = (1 - alpha) * np.linalg.inv(cov_a[i]), alpha * np.linalg.inv(cov_b[j])
        covariance = np.linalg.inv(first + second)
        mean = mean_a[i] + covariance @ (second @ apart[i, j])
        out.append((mean, covariance, weight_a[i] * weight_b[j] * (1 / sum_a[i] + 1 / sum_b[j])))
    return out

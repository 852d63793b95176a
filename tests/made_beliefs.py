"""Beliefs for tests: particles that weigh alike, and Gaussians along the x axis."""

import numpy as np
from numpy.typing import ArrayLike

from omninav.stages.values.belief import GaussianMixture, Particles


def even(poses: ArrayLike) -> Particles:
    """Particles at poses (N, 3) that weigh alike."""
    at = np.asarray(poses, np.float64)
    return Particles(at, np.full(len(at), 1.0 / len(at)))


def scattered_around(pose: ArrayLike, spread: ArrayLike, number: int) -> Particles:
    """As many particles, normally distributed around a pose."""
    return even(np.random.default_rng(0).normal(np.asarray(pose), np.asarray(spread), (number, 3)))


def along_x(*places: float, sigma: float = 0.1, weights: tuple[float, ...] | None = None) -> GaussianMixture:
    """Gaussians at (x, 0, 0), as wide in all directions; they weigh alike, 1 together, where no weights are given."""
    number = len(places)
    means = np.column_stack([places, np.zeros((number, 2))]).astype(np.float64)
    shares = np.full(number, 1.0 / max(number, 1)) if weights is None else np.array(weights)
    return GaussianMixture(means, np.tile(sigma**2 * np.eye(3), (number, 1, 1)), shares)

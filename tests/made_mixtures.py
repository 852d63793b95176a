"""Mixtures of Gaussians over poses for property tests, and plain references to compare with."""

import math

import numpy as np
from hypothesis import strategies as st

Mixture = tuple[np.ndarray, np.ndarray, np.ndarray]

_sigma = st.floats(0.02, 0.6)
_correlation = st.floats(-0.9, 0.9)


@st.composite
def covariances(draw: st.DrawFn) -> np.ndarray:
    """A positive definite covariance (3, 3) with sigmas from 2 cm and 0.02 rad to 0.6 m and 0.6 rad."""
    factor = np.eye(3)
    factor[1, 0], factor[2, 0], factor[2, 1] = draw(_correlation), draw(_correlation), draw(_correlation)
    factor /= np.linalg.norm(factor, axis=1, keepdims=True)
    factor *= np.array([draw(_sigma), draw(_sigma), draw(_sigma)])[:, None]
    return factor @ factor.T


@st.composite
def mixtures(draw: st.DrawFn, most: int = 6, extent: float = 3.0, least: int = 1) -> Mixture:
    """Means over a few metres and all headings, covariances, and weights above 0 that sum to 1."""
    number = draw(st.integers(least, most))
    places = st.floats(-extent, extent)
    means = np.array([[draw(places), draw(places), draw(st.floats(-math.pi, 3.14))] for _ in range(number)])
    weights = np.array([draw(st.floats(0.01, 1.0)) for _ in range(number)])
    return means, np.stack([draw(covariances()) for _ in range(number)]), weights / weights.sum()


def drawn_mixture(rng: np.random.Generator, number: int, extent: float = 3.0) -> Mixture:
    """The same from a generator, where thousands are wanted."""
    means = np.column_stack([rng.uniform(-extent, extent, (number, 2)), rng.uniform(-math.pi, math.pi, number)])
    factors = rng.normal(size=(number, 3, 3)) * np.array([0.2, 0.2, 0.1])[:, None]
    weights = rng.uniform(0.01, 1.0, number)
    return means, factors @ np.swapaxes(factors, 1, 2) + np.diag([1e-3, 1e-3, 1e-4]), weights / weights.sum()


def gap(start: np.ndarray, end: np.ndarray) -> np.ndarray:
    """From one pose to another, with the shorter turn: by the angle of a complex number, not by a modulo."""
    turn = np.angle(np.exp(1j * (end[2] - start[2])))
    return np.array([end[0] - start[0], end[1] - start[1], turn])


def half_a_turn_apart(a: np.ndarray, b: np.ndarray) -> bool:
    """Whether any heading of poses (A, 3) lies opposite to one of (B, 3): neither turn between them is the shorter."""
    turns = np.angle(np.exp(1j * (b[None, :, 2] - a[:, None, 2])))
    return bool((np.abs(turns) > math.pi - 1e-6).any())

"""Random pairs of views of the same points, all around the camera."""

import math

import numpy as np
from scipy.spatial.transform import Rotation

Array = np.ndarray


def unit(vectors: Array) -> Array:
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def two_views(
    seed: int, number: int = 100, wrong: float = 0.0, noise_deg: float = 0.0, planar: bool = True
) -> tuple[Array, Array, Array, Array]:
    """R, t (X1 = R X2 + t, |t| = 1) and unit bearings (N, 3) of both views; the first `wrong` share of pairs is not."""
    rng = np.random.default_rng(seed)
    if planar:
        rotation = Rotation.from_euler("z", rng.uniform(-math.pi, math.pi)).as_matrix()
        along = rng.uniform(-math.pi, math.pi)
        translation = np.array([math.cos(along), math.sin(along), 0.0])
    else:
        rotation = Rotation.random(rng=rng).as_matrix()
        translation = unit(rng.normal(size=3))
    points = unit(rng.normal(size=(number, 3))) * rng.uniform(1.5, 6.0, (number, 1))
    first, second = unit(points), unit((points - translation) @ rotation)
    noise = math.radians(noise_deg)
    first = unit(first + noise * rng.normal(size=first.shape))
    second = unit(second + noise * rng.normal(size=second.shape))
    broken = round(wrong * number)
    second[:broken] = unit(rng.normal(size=(broken, 3)))
    return rotation, translation, first, second


def angle_deg(one: Array, two: Array) -> float:
    """Between two unit vectors, or between two rotations (3, 3)."""
    if one.ndim == 2:
        return math.degrees(np.linalg.norm(Rotation.from_matrix(one.T @ two).as_rotvec()))
    return math.degrees(math.atan2(np.linalg.norm(np.cross(one, two)), float(one @ two)))

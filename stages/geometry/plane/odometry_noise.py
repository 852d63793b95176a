"""Noise added to odometry motions."""

import math

import numpy as np
import numpy.typing as npt

from omninav.stages.geometry.arrays import Array

Triple = tuple[float, float, float]


def add_odometry_noise(motions: npt.ArrayLike, triple: Triple, drawn: npt.ArrayLike) -> Array:
    """Motions (N, 3), x, y, turn, with noise of a `triple`, from standard normal numbers `drawn` (N, 3).

    Each motion is a rotation, a translation and a rotation, and each of the three gets its own error (Wolf, Burgard &
    Burkhardt 2005, section VI-D and figure 16; erratum 46a in docs/papers.md). The paper prints triples without units.
    We read them as those of Gutmann, Burgard & Konolige (1998), whose model it states to follow: <a, b, c> are the
    standard deviations of the translation in mm per sqrt(m), of a turn in degrees per sqrt(360 degrees) turned, and in
    degrees per sqrt(m) driven. Both rotations share the latter two evenly. So the noise does not depend on how many
    motions a path is cut into. A motion backwards is a negative translation, not two half turns.
    """
    motions, drawn = np.asarray(motions, dtype=np.float64), np.asarray(drawn, dtype=np.float64)
    distance = np.hypot(motions[:, 0], motions[:, 1])
    forward = np.where(motions[:, 0] < 0.0, -1.0, 1.0)
    towards = np.where(distance > 1e-9, np.arctan2(forward * motions[:, 1], forward * motions[:, 0]), 0.0)
    distance_sigma = triple[0] * 1e-3 * np.sqrt(distance)
    turn_variance = math.radians(triple[1]) ** 2 * np.abs(motions[:, 2]) / (2 * math.pi)
    turn_variance += math.radians(triple[2]) ** 2 * distance
    turn_sigma = np.sqrt(turn_variance / 2)
    first = towards + turn_sigma * drawn[:, 0]
    translation = forward * (distance + distance_sigma * drawn[:, 1])
    turn = motions[:, 2] + turn_sigma * (drawn[:, 0] + drawn[:, 2])
    return np.stack([translation * np.cos(first), translation * np.sin(first), turn], axis=1)

"""Landmarks to expect in an image: as many as the nearest reference sees, less by its distance and by the light."""

import math

import numpy as np

from omninav.pipeline import Value
from omninav.stages.geometry.arrays import Array, Ints
from omninav.stages.values.landmarks import Landmarks

BESIDE, HALF_AT = 0.45, 1.6
"""Share of the landmarks of the nearest reference that agree on the pose of an image beside it, and the distance, in
length scales, at which half as many do: medians over drawn rooms by day (docs/experiments/landmarks.md)."""
AT_FIRST = 0.4
"""Share of the landmarks to expect that images show, before a drive has told it: between rooms by day, 1, and with half
of the lamps off, 0.3."""
ADAPTED = 0.05
"""Weight of a certain pose in the mean over a drive; others count by their probability."""
MAX_AGAINST = 4.0
"""Largest log odds (nats) against a pose by landmarks that are missing: people may hide them."""


class LandmarksShown(Value):
    """Share of the landmarks to expect that the images of a drive show: its logarithm, the mean over likely poses."""

    log_share: float = math.log(AT_FIRST)

    def log_odds(self, shown: Ints, expected: Array) -> Array:
        """Log odds (K,), at most 0, of poses on which so many landmarks (K,) agree, by how many are missing there.

        The logarithm of the share has a standard deviation of 1: within a drive of a half, and more between its rooms.
        """
        missing = np.maximum(self.log_share - _log_shares(shown, expected), 0.0)
        return np.asarray(-np.minimum(0.5 * np.square(missing), MAX_AGAINST))

    def seen(self, shown: Ints, expected: Array, probability: float) -> "LandmarksShown":
        """Gives the share after an image with a pose (K = 1) of this probability."""
        told = min(float(_log_shares(shown, expected)[0]), 0.0)
        return LandmarksShown(self.log_share + ADAPTED * probability * (told - self.log_share))


def landmarks_to_expect(landmarks: Landmarks, references: Array, poses: Array, metres: float) -> Array:
    """Number of landmarks (K,) that agree on each of some poses (K, 3) by day, of a map with `references` (R, 3).

    `metres`: the map's length scale.
    """
    learned = references[: landmarks.references, :2]  # a reference that a map has learned since sees none
    gaps = np.hypot(*(poses[:, None, :2] - learned).transpose(2, 0, 1))
    nearest = gaps.argmin(axis=1)
    scales = gaps[np.arange(len(poses)), nearest] / metres
    seen = landmarks.starts[nearest + 1] - landmarks.starts[nearest]
    return np.asarray(BESIDE * seen * 2.0 ** -((np.minimum(scales, 1e3) / HALF_AT) ** 1.5))


def _log_shares(shown: Ints, expected: Array) -> Array:
    return np.asarray(np.log(shown / np.maximum(expected, 1.0)))

"""Errors of poses against true poses: metres and degrees."""

import numpy as np

from omninav.stages.geometry.arrays import Array

from .se2 import wrap


def position_errors(poses: Array, truth: Array) -> Array:
    """Distance (m) between poses and truth, both (N, 3): (N,)."""
    return np.hypot(poses[:, 0] - truth[:, 0], poses[:, 1] - truth[:, 1])


def heading_errors_deg(poses: Array, truth: Array) -> Array:
    """Size of the heading's difference (degrees, 0 to 180) between poses and truth, both (N, 3): (N,)."""
    return np.degrees(np.abs(wrap(poses[:, 2] - truth[:, 2])))


def first_settled(
    position_m: Array, heading_deg: Array, within_m: float = 1.0, within_deg: float = 20.0, frames: int = 10
) -> int | None:
    """The first index from which `frames` entries in a row stay below both limits; None where there is none."""
    good = (position_m < within_m) & (heading_deg < within_deg)
    if len(good) < frames:
        return None
    runs = np.convolve(good, np.ones(frames, dtype=np.int64), mode="valid") == frames
    return int(np.argmax(runs)) if runs.any() else None

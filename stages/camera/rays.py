"""Rays: directions in the robot's frame (x forward, y left, z up) from the camera's projection centre."""

import math

import numpy as np
import numpy.typing as npt

from omninav.stages.geometry.arrays import Array


def unit_vectors(azimuths: npt.ArrayLike, elevations: npt.ArrayLike) -> Array:
    """Rays (..., 3) of azimuths (rad, counter-clockwise from forward) and elevations (rad above the horizon)."""
    level = np.cos(elevations)
    parts = np.broadcast_arrays(level * np.cos(azimuths), level * np.sin(azimuths), np.sin(elevations))
    return np.stack(parts, axis=-1).astype(np.float64)


def angles(rays: Array) -> tuple[Array, Array]:
    """Azimuths and elevations (...,) of rays (..., 3) of any length."""
    return np.arctan2(rays[..., 1], rays[..., 0]), np.arctan2(rays[..., 2], np.hypot(rays[..., 0], rays[..., 1]))


def turned(rays: Array, yaw: float) -> Array:
    """Rays (..., 3) turned about z, counter-clockwise by `yaw` (rad)."""
    cos, sin = math.cos(yaw), math.sin(yaw)
    x, y = rays[..., 0], rays[..., 1]
    return np.stack([cos * x - sin * y, sin * x + cos * y, rays[..., 2]], axis=-1)


def normalised(rays: Array) -> Array:
    """Rays (..., 3) of unit length; NaN where they are NaN or zero."""
    with np.errstate(divide="ignore", invalid="ignore"):
        unit: Array = rays / np.linalg.norm(rays, axis=-1, keepdims=True)
    return unit

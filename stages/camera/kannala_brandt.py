"""A fisheye lens by an odd polynomial of the angle, as OpenCV, Kalibr and ROS ("equidistant") calibrate it."""

import math
from collections.abc import Sequence
from typing import Annotated, Any, Self

import numpy as np

from omninav.stages.geometry.arrays import Array

from .calibrated_lens import MAX_COEFFICIENT, CalibratedLens, Coefficient, require_all, smallest_root
from .model import Key

STEPS = 1024
"""Angles between which the polynomial is inverted before Newton's method refines them."""


class KannalaBrandt(CalibratedLens, projection="kannala_brandt"):
    """A ray at an angle t from the axis is seen at the radius t + k1 t^3 + k2 t^5 + k3 t^7 + k4 t^9.

    Kannala & Brandt 2006, "A generic camera model and calibration method for conventional, wide-angle, and fish-eye
    lenses", PAMI 28(8) (doi 10.1109/TPAMI.2006.153), equation 6, with the first coefficient in K. It holds as far from
    the axis as the radius grows.
    """

    distortion: Annotated[tuple[Coefficient, ...], Key("", "D")]
    """k1, k2, k3, k4."""

    def __post_init__(self) -> None:
        require_all(self.distortion, "k1, k2, k3, k4")
        super().__post_init__()

    def onto_plane(self, rays: Array) -> Array:
        """The direction around the axis, at the polynomial's radius."""
        aside = np.hypot(rays[..., 0], rays[..., 1])
        angle = np.arctan2(aside, rays[..., 2])
        radius = np.where(angle <= self._max_angle(), self._radius(angle), np.nan)
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.asarray(rays[..., :2] * np.where(aside > 0.0, radius / aside, 1.0)[..., None])

    def from_plane(self, points: Array) -> Array:
        """The angle whose radius this is: between tabled ones, then by Newton's method."""
        largest, radius = self._max_angle(), np.hypot(points[..., 0], points[..., 1])
        angles = np.linspace(0.0, largest, STEPS)
        angle = np.interp(radius, self._radius(angles), angles, right=np.nan)
        derivative = self._radius.deriv()
        with np.errstate(divide="ignore", invalid="ignore"):
            for _ in range(3):
                angle = np.clip(angle - (self._radius(angle) - radius) / derivative(angle), 0.0, largest)
            scale = np.where(radius > 0.0, np.sin(angle) / radius, 1.0)
        return np.concatenate([scale[..., None] * points, np.cos(angle)[..., None]], axis=-1)

    @property
    def _radius(self) -> np.polynomial.Polynomial:
        k1, k2, k3, k4 = self.distortion
        return np.polynomial.Polynomial([0.0, 1.0, 0.0, k1, 0.0, k2, 0.0, k3, 0.0, k4])

    def _max_angle(self) -> float:
        """The angle (rad) up to which the radius grows: beyond it, a pixel would show two rays."""
        return min(smallest_root(self._radius.deriv()), math.pi)

    def camera_info(self) -> dict[str, Any]:
        """K and D of ROS's model "equidistant"."""
        return {"distortion_model": "equidistant", "k": self.k, "d": list(self.distortion)}

    @classmethod
    def from_camera_info(cls, model: str, size: tuple[int, int], k: Sequence[float], d: Sequence[float]) -> Self | None:
        """Camera of ROS's model "equidistant"; it looks up, all of the circle that fits the image is used."""
        if model != "equidistant" or len(d) != 4 or max(map(abs, d)) > MAX_COEFFICIENT:
            return None
        return cls(*size, k[0], k[4], k[2], k[5], tuple(d), skew=k[1])

"""A perspective camera that looks up into a hyperbolic mirror."""

import math
from collections.abc import Sequence
from typing import Annotated, Any, Self

import numpy as np

from omninav.pipeline import Bounds
from omninav.stages.geometry.arrays import Array, Bools

from .intrinsic_matrix import IntrinsicMatrix
from .model import InnerRadius, Key, OuterRadius, Ring
from .rays import normalised, turned

HalfAxis = Bounds(ge=1e-5, le=1e5)
"""Bounds of a half axis: from a mirror of a tenth of a millimetre in metres to one of a hundred metres in
millimetres."""


class HyperbolicMirror(IntrinsicMatrix, projection="hyperbolic"):
    """A hyperbolic mirror over a perspective camera, by closed forms (Svoboda & Pajdla; erratum 33, docs/papers.md).

    Mirror frame: origin at the mirror's focus, z up along the axis; image u runs along mirror x and image v along
    mirror y, so a pixel's bearing is atan2(v - cy, u - cx) + yaw. The mirror is (z+e)^2/a^2 - (x^2+y^2)/b^2 = 1 with
    e = sqrt(a^2+b^2); the camera's centre is t_c = (0, 0, -2e), and it looks along +z (equations 15, 16 and 20 of the
    paper behind `topological_nav`).
    """

    sees_itself = True

    a: Annotated[float, Key("mirror", "a"), HalfAxis]
    """Half axis of the hyperbola along the mirror's axis, in the unit of `b`: rays have no length."""
    b: Annotated[float, Key("mirror", "b"), HalfAxis]
    """Half axis of the hyperbola across the mirror's axis."""
    inner_radius_px: InnerRadius
    """Inside it, around the principal point, the robot sees itself."""
    outer_radius_px: OuterRadius
    """The mirror's rim."""

    @property
    def ring(self) -> Ring:
        """Pixels between the camera's own reflection and the mirror's rim."""
        return Ring(self.centre_x, self.centre_y, self.inner_radius_px, self.outer_radius_px)

    def project(self, rays: Array) -> tuple[Array, Bools]:
        """lambda = b^2 / (a |X| - e X_3), p ~ K (lambda X - t_c), valid iff a |X| > e X_3.

        The largest root, as the paper has it, lands on the wrong sheet for steep downward rays; this form never does.
        """
        rays = turned(rays, -self.yaw)
        e = math.hypot(self.a, self.b)
        denominator = self.a * np.linalg.norm(rays, axis=-1) - e * rays[..., 2]
        with np.errstate(divide="ignore", invalid="ignore"):
            scale = np.where(denominator > 0.0, self.b * self.b / denominator, np.nan)
            depth = scale * rays[..., 2] + 2.0 * e
            qx, qy = scale * rays[..., 0] / depth, scale * rays[..., 1] / depth
        pixels = self.pixels_of(np.stack([qx, qy], axis=-1))
        return pixels, self.shows(pixels)

    def unproject(self, pixels: Array) -> tuple[Array, Bools]:
        """q = K^-1 p, F = b^2 / (e - a |q|), ray = F q + t_c, valid iff |q| < e / a."""
        e = math.hypot(self.a, self.b)
        qx, qy = np.moveaxis(self.points_of(pixels), -1, 0)
        denominator = e - self.a * np.sqrt(qx * qx + qy * qy + 1.0)
        looks: Bools = denominator > 0.0
        with np.errstate(divide="ignore", invalid="ignore"):
            scale = np.where(looks, self.b * self.b / np.where(looks, denominator, 1.0), np.nan)
        ray = np.stack([scale * qx, scale * qy, scale - 2.0 * e], axis=-1)
        return turned(normalised(ray), self.yaw), looks

    def camera_info(self) -> dict[str, Any]:
        """K, and the mirror's half axes as D."""
        return {"k": self.k, "distortion_model": "hyperbolic_mirror", "d": [self.a, self.b]}

    @classmethod
    def from_camera_info(cls, model: str, size: tuple[int, int], k: Sequence[float], d: Sequence[float]) -> Self | None:
        """Camera of `hyperbolic_mirror` with d = [a, b]: the whole circle that fits the image is used, and yaw is 0."""
        if model != "hyperbolic_mirror" or len(d) < 2:
            return None
        outer = min(k[2], size[0] - 1 - k[2], k[5], size[1] - 1 - k[5])
        return cls(*size, k[0], k[4], k[2], k[5], d[0], d[1], 0.0, outer, skew=k[1])

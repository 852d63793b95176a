"""An ordinary camera that looks ahead."""

import math
from collections.abc import Sequence
from typing import Any, Self

import numpy as np

from omninav.stages.geometry.arrays import Array, Bools

from .intrinsic_matrix import IntrinsicMatrix
from .rays import normalised, turned


class Perspective(IntrinsicMatrix, projection="perspective"):
    """A pinhole camera without distortion, looking along the robot's forward turned by `yaw`."""

    def project(self, rays: Array) -> tuple[Array, Bools]:
        """p ~ K (-y, -z, x); what is behind is not shown."""
        ahead = turned(rays, -self.yaw)
        with np.errstate(divide="ignore", invalid="ignore"):
            depth = np.where(ahead[..., 0] > 0.0, ahead[..., 0], np.nan)
            right, down = -ahead[..., 1] / depth, -ahead[..., 2] / depth
        pixels = self.pixels_of(np.stack([right, down], axis=-1))
        return pixels, self.shows(pixels)

    def unproject(self, pixels: Array) -> tuple[Array, Bools]:
        """K^-1 p; every pixel looks somewhere."""
        right, down = np.moveaxis(self.points_of(pixels), -1, 0)
        rays = np.stack([np.ones_like(down), -right, -down], axis=-1)
        return turned(normalised(rays), self.yaw), np.ones(down.shape, np.bool_)

    @classmethod
    def of_size(cls, width: int, height: int) -> Self:
        """A field of view of 60 degrees, as webcams have."""
        focal = width / (2.0 * math.tan(math.radians(30.0)))
        return cls(width, height, focal, focal, (width - 1) / 2, (height - 1) / 2)

    def camera_info(self) -> dict[str, Any]:
        """K."""
        return {"k": self.k}

    @classmethod
    def from_camera_info(cls, model: str, size: tuple[int, int], k: Sequence[float], d: Sequence[float]) -> Self | None:
        """Camera of an undistorted image."""
        if model not in ("", "plumb_bob", "rational_polynomial") or any(d):
            return None
        return cls(*size, k[0], k[4], k[2], k[5], skew=k[1])

"""Two fisheye lenses back to back, whose images are side by side in one, as 360-degree cameras record them."""

import math
from typing import Annotated, Self

import numpy as np

from omninav.pipeline import Bounds
from omninav.stages.geometry.arrays import Array, Bools

from .model import FAR_PX, Camera, Key
from .rays import normalised, turned

Place = Annotated[float, Bounds(ge=-FAR_PX, le=FAR_PX)]


class DualFisheye(Camera, projection="dual_fisheye"):
    """Two equidistant lenses: one looks ahead, the other one back, both level and upright.

    A pixel's distance from the centre of its circle grows with the angle from the lens's axis, by `focal_px` per
    radian. Where both lenses see a ray, that whose axis is nearer shows it. `yaw` turns both.
    """

    focal_px: Annotated[float, Bounds(gt=0, le=FAR_PX)]
    """Pixels per radian, of both lenses."""
    ahead_x: Annotated[Place, Key("ahead", "x")]
    """Centre of the circle of the lens that looks ahead (pixels), as the next three."""
    ahead_y: Annotated[Place, Key("ahead", "y")]
    back_x: Annotated[Place, Key("back", "x")]
    back_y: Annotated[Place, Key("back", "y")]
    outer_radius_px: Annotated[float, Key("mask", "outer_radius_px"), Bounds(gt=0, le=FAR_PX)]
    """Radius of both circles (pixels)."""
    ahead_roll: Annotated[float, Key("ahead", "roll")] = 0.0
    """Radians, clockwise on the screen, by which the image of the lens that looks ahead is turned."""
    back_roll: Annotated[float, Key("back", "roll")] = 0.0
    """The same of the other lens."""

    @classmethod
    def of_size(cls, width: int, height: int) -> Self:
        """Circles of 190 degrees that fill the halves of the image, the lens that looks ahead on the left."""
        radius, middle = min(width / 2, height) / 2, (height - 1) / 2
        focal = radius / math.radians(95.0)
        return cls(width, height, focal, width / 4 - 0.5, middle, 3 * width / 4 - 0.5, middle, radius)

    @property
    def upright(self) -> bool:
        """Upright lines are bent, and turned by the roll."""
        return False

    @property
    def elevations(self) -> tuple[float, float]:
        """The whole sphere."""
        return math.pi / 2, -math.pi / 2

    def shows(self, pixels: Array) -> Bools:
        """Which pixels are in the image and show what the other lens's axis is not nearer to."""
        radius = min(self.outer_radius_px, self.focal_px * math.pi / 2 + 1e-6)
        return np.asarray(super().shows(pixels) & (self._away(pixels).min(axis=0) <= radius))

    def project(self, rays: Array) -> tuple[Array, Bools]:
        """Radius = focal_px x angle from the axis of the lens that is nearer."""
        rays = normalised(turned(rays, -self.yaw))
        back = rays[..., 0] < 0.0
        ahead, right, down = abs(rays[..., 0]), np.where(back, rays[..., 1], -rays[..., 1]), -rays[..., 2]
        aside = np.hypot(right, down)
        radius = self.focal_px * np.arctan2(aside, ahead)
        with np.errstate(divide="ignore", invalid="ignore"):
            scale = np.where(aside > 0.0, radius / aside, 0.0)
        roll = np.where(back, self.back_roll, self.ahead_roll)
        u = np.where(back, self.back_x, self.ahead_x) + scale * (right * np.cos(roll) - down * np.sin(roll))
        v = np.where(back, self.back_y, self.ahead_y) + scale * (right * np.sin(roll) + down * np.cos(roll))
        pixels = np.stack([u, v], axis=-1)
        return pixels, self.shows(pixels)

    def unproject(self, pixels: Array) -> tuple[Array, Bools]:
        """Angle from the axis = radius / focal_px, of the circle whose centre is nearer."""
        away = self._away(pixels)
        back = away[1] < away[0]
        x = pixels[..., 0] - np.where(back, self.back_x, self.ahead_x)
        y = pixels[..., 1] - np.where(back, self.back_y, self.ahead_y)
        roll = np.where(back, self.back_roll, self.ahead_roll)
        right, down = x * np.cos(roll) + y * np.sin(roll), y * np.cos(roll) - x * np.sin(roll)
        angle = np.hypot(x, y) / self.focal_px
        looks: Bools = angle <= math.pi
        with np.errstate(divide="ignore", invalid="ignore"):
            aside = np.where(angle > 0.0, np.sin(angle) / np.hypot(x, y), 0.0)
        side = np.where(back, -1.0, 1.0)
        rays = np.stack([side * np.cos(angle), -side * right * aside, -down * aside], axis=-1)
        return np.where(looks[..., None], turned(rays, self.yaw), np.nan), looks

    def _away(self, pixels: Array) -> Array:
        """Distances (2, ...) of pixels from the centres of both circles."""
        centres = np.array([[self.ahead_x, self.ahead_y], [self.back_x, self.back_y]])
        return np.asarray(np.hypot(*np.moveaxis(pixels - centres.reshape(2, *[1] * (pixels.ndim - 1), 2), -1, 0)))

"""Images of a mirror: texture within a ring, dark around it."""

import cv2
import numpy as np

from omninav.stages.values.image import Pixels


def ring_picture(
    centre: tuple[float, float], outer: float, inner: float, seed: int, size: tuple[int, int] = (640, 480)
) -> Pixels:
    rng = np.random.default_rng(seed)
    v, u = np.mgrid[0 : size[1], 0 : size[0]]
    radius = np.hypot(u - centre[0], v - centre[1])
    texture = cv2.GaussianBlur(rng.integers(60, 256, (*size[::-1], 3), dtype=np.uint8), (0, 0), 3)
    pixels = np.where(((radius < outer) & (radius > inner))[..., None], texture, 12)
    return pixels.astype(np.uint8)

"""The floor among the landmarks: what gives a map that odometry has scaled its true size."""

import math

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

RANGE = 0.2
"""Part of the camera's height by which the floor may seem to lie higher or lower: odometry is off by less."""
BANDWIDTH = 0.01
"""Standard deviation of the kernel that smooths the landmarks' depths, as a part of the camera's height."""
STEPS = 401
"""Depths at which the density is evaluated."""
MIN_PEAK = 2.0
"""Density at the floor, over the mean of that above it within `RANGE`, at least: less is furniture."""
MIN_LANDMARKS = 50
"""Landmarks within about a bandwidth of the floor, at least."""


def floor_depth(points: Array, height: float) -> float | None:
    """Metres of the floor below the cameras of a map: the depth at which most landmarks lie, near `height`.

    `points` (L, 3): with z = 0 at the cameras' height, in the map's own scale; `height`: of the camera over the floor,
    as it is known. A map times `height` / depth has its true size. None where no depth stands out, as on a floor
    without texture.
    """
    depths = -points[:, 2] / height
    near = depths[np.abs(depths - 1.0) < RANGE + 3.0 * BANDWIDTH]
    if len(near) < MIN_LANDMARKS:
        return None
    at = np.linspace(1.0 - RANGE, 1.0 + RANGE, STEPS)
    density = np.exp(-0.5 * ((at[:, None] - near) / BANDWIDTH) ** 2).sum(axis=1)
    best = int(density.argmax())
    above = density[at < at[best] - 4.0 * BANDWIDTH]
    if density[best] < max(MIN_LANDMARKS, MIN_PEAK * above.mean() if len(above) else math.inf):
        return None
    return float(at[best]) * height

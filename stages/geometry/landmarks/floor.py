"""The floor among the landmarks: what gives a map that odometry has scaled its true size."""

import numpy as np

from omninav.stages.geometry.arrays import Array, Ints

RANGE = 0.25
"""Part of the camera's height by which the floor may seem higher or lower: odometry is off by less."""
NEAR = 1.7
"""Horizontal distance of a landmark from the nearest reference that sees it, as a part of the camera's height, beyond
which it is left out: the floor is then seen at less than 30 degrees below the horizon, and its depth is uncertain."""
BANDWIDTH = 0.01
"""Standard deviation of the kernel that smooths the landmarks' depths, as a part of the camera's height."""
SPREAD = 0.08
"""Part of the camera's height by which depths of the floor scatter about it."""
STEPS = 501
"""Depths at which the density is evaluated."""
MIN_PEAK = 2.0
"""Density at the floor, over the mean of that above it within `RANGE`, at least: less is furniture."""
MIN_STEEP = 40
"""Landmarks seen steeply below, at least, where no scale is known."""
LOG_STEP = 0.01
"""Step of the logarithm of the depth there."""
LOW_PEAK = 0.7
"""Density of a depth below the densest one, as a part of its density, from which the floor is there: a table may hold
as many landmarks as the floor, and what a polished floor mirrors holds fewer."""
MIN_LANDMARKS = 50
"""Landmarks within about a bandwidth of the floor, at least."""


def floor_depth(points: Array, poses: Array, references: Ints, landmarks: Ints, height: float) -> float | None:
    """Metres of the floor below the cameras of a map: the depth at which most landmarks are, near `height`.

    `points` (L, 3): with z = 0 at the cameras' height, and `poses` (R, 3) of the references, both in the map's own
    scale; `references`, `landmarks` (O,): of each sighting; `height`: of the camera over the floor, as it is known. A
    map times `height` / depth has its true size. None where no depth stands out, as on a floor without texture.
    """
    depths = -points[_distances(points, poses, references, landmarks) < NEAR * height, 2] / height
    near = depths[np.abs(depths - 1.0) < RANGE + 3.0 * BANDWIDTH]
    if len(near) < MIN_LANDMARKS:
        return None
    at = np.linspace(1.0 - RANGE, 1.0 + RANGE, STEPS)
    density = np.exp(-0.5 * ((at[:, None] - near) / BANDWIDTH) ** 2).sum(axis=1)
    best = int(density.argmax())
    above = density[at < at[best] - SPREAD]
    if not len(above) or density[best] < max(MIN_LANDMARKS, MIN_PEAK * above.mean()):
        return None
    return float(at[best]) * height


def lowest_plane(points: Array, poses: Array, references: Ints, landmarks: Ints) -> float | None:
    """Depth of the floor below the cameras where nothing is known of the scale, in its own unit.

    Arguments as of `floor_depth`. Little is seen below a floor: of the depths at which most landmarks are, or nearly as
    many (`LOW_PEAK`), it is the largest. None where no depth stands out.
    """
    distances = _distances(points, poses, references, landmarks)
    near = np.log(-points[(points[:, 2] < 0.0) & (distances < -NEAR * points[:, 2]), 2])
    if len(near) < MIN_STEEP:
        return None
    at = np.arange(near.min(), near.max() + LOG_STEP, LOG_STEP)
    density = np.exp(-0.5 * ((at[:, None] - near) / (2.0 * BANDWIDTH)) ** 2).sum(axis=1)
    around = np.pad(density, 1)
    strong = density > max(MIN_STEEP / 3.0, LOW_PEAK * density.max())
    peaks = np.flatnonzero(strong & (density >= around[:-2]) & (density > around[2:]))
    return float(np.exp(at[peaks[-1]])) if len(peaks) else None


def _distances(points: Array, poses: Array, references: Ints, landmarks: Ints) -> Array:
    """Horizontal distance (L,) of each landmark from the nearest reference that sees it."""
    distances = np.full(len(points), np.inf)
    np.minimum.at(distances, landmarks, np.hypot(*(points[landmarks] - poses[references])[:, :2].T))
    return distances

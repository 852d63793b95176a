"""Weighted pose samples: moments and modes."""

import numpy as np
import numpy.typing as npt

from .se2 import wrap

Array = npt.NDArray[np.float64]


def weighted_moments(poses: Array, weights: Array) -> tuple[Array, Array]:
    """Mean pose (3,) and covariance (3, 3) of weighted poses (N, 3); the heading's mean is circular."""
    share = weights / weights.sum()
    heading = np.arctan2(share @ np.sin(poses[:, 2]), share @ np.cos(poses[:, 2]))
    mean = np.array([share @ poses[:, 0], share @ poses[:, 1], heading])
    spread = poses - mean
    spread[:, 2] = wrap(spread[:, 2])
    return mean, (spread * share[:, None]).T @ spread


def heaviest_mode(poses: Array, weights: Array, radius: float = 1.0) -> tuple[Array, Array, float]:
    """The heaviest mode of weighted poses: its mean (3,), covariance (3, 3) and share of the weight.

    The plane is cut into cells of `radius` / 2 (m) and 12 headings; the heaviest cell, summed with its neighbours,
    starts a mean shift with a flat kernel of `radius` metres and 30 degrees that stops when its members stay the same.
    """
    cell = radius / 2
    keys = np.column_stack([np.floor(poses[:, :2] / cell), np.floor(np.mod(poses[:, 2], 2 * np.pi) / (np.pi / 6))])
    keys[:, 2] = np.mod(keys[:, 2], 12)
    cells, inverse = np.unique(keys.astype(np.int64), axis=0, return_inverse=True)
    mass = np.bincount(inverse.ravel(), weights=weights, minlength=len(cells))
    heaviest = np.argsort(-mass, kind="stable")[:64]  # a mode lighter than 64 others is not the heaviest
    gap = np.abs(cells[heaviest, None, :] - cells[None, :, :])
    gap[..., 2] = np.minimum(gap[..., 2], 12 - gap[..., 2])
    around = (gap <= 1).all(axis=2) @ mass
    start = cells[heaviest[int(np.argmax(around))]]
    centre = np.array([(start[0] + 0.5) * cell, (start[1] + 0.5) * cell, wrap((start[2] + 0.5) * np.pi / 6)])
    members = np.zeros(len(poses), dtype=bool)
    for _ in range(20):
        near = np.hypot(poses[:, 0] - centre[0], poses[:, 1] - centre[1]) < radius
        near &= np.abs(wrap(poses[:, 2] - centre[2])) < np.pi / 6
        if not near.any() or np.array_equal(near, members) or weights[near].sum() <= 0:
            break
        members = near
        centre, _ = weighted_moments(poses[members], weights[members])
    if not members.any() or weights[members].sum() <= 0:
        members = np.ones(len(poses), dtype=bool)
    mean, covariance = weighted_moments(poses[members], weights[members])
    return mean, covariance, float(weights[members].sum() / weights.sum())

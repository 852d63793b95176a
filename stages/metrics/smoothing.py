"""Trajectories that agree best with estimates and odometry, before and after."""

from itertools import pairwise

import numpy as np

from omninav.stages.geometry.arrays import Array, Bools, Ints
from omninav.stages.geometry.plane.drive_graph import SIGMA_PER_METRE, odometry_sigmas
from omninav.stages.geometry.plane.pose_errors import heading_errors_deg, position_errors
from omninav.stages.geometry.plane.pose_graph import optimised_poses
from omninav.stages.geometry.plane.se2 import between, chain, compose

MIN_SIGMAS = np.array([0.001, 0.001, np.radians(0.02)])
"""Smallest standard deviation of an estimate (m, m, rad)."""
MAX_SIGMAS = np.array([1.0, 1.0, np.radians(30.0)])
"""Largest standard deviation of an estimate with a stated trust (m, m, rad), the radii of a mode: beyond them the trust
tells how wrong it may be. Without one (a trust of 1) the covariance alone does."""
MIN_TRUST = 0.01
"""Smallest probability at which an estimate still counts."""
OFF_SCALE, SPAN = 0.08, 10
"""Largest share by which odometry's length may differ from that of trusted estimates this many poses apart, and be
believed to `SIGMA_PER_METRE`: filters that lag behind make up to 0.07 of it."""
JUMP_M, JUMP_DEG = 1.0, 20.0
"""Differences beyond which estimates contradict odometry."""
STRETCH, WITNESSES = 5, 10
"""Estimates that odometry has to agree with to be contradicted by them, and how many on each side are asked."""
MAX_POSES = 5000
"""Poses of a graph; of a longer drive every second, every third, …, those between follow odometry."""


def smoothed(estimates: Array, covariances: Array, trust: Array, motions: Array) -> Array:
    """Poses (N, 3) of a drive by the estimates and odometry of all of it: (N, 3).

    `estimates` (N, 3), NaN where there are none, with `covariances` (N, 3, 3) and `trust` (N,), the probability that
    each is right; `motions` (N, 3): odometry since the pose before. A pose graph, in which odometry is firm and
    estimates count by Cauchy's function, so that those which the others and odometry contradict count little. Where
    trusted estimates on both sides contradict odometry, the robot was carried: there odometry is doubted as well.
    """
    motions = motions.copy()
    motions[0] = 0.0
    path = chain(motions)
    known = np.flatnonzero(np.isfinite(estimates).all(axis=1))
    rows = known[:: -(-len(known) // MAX_POSES)]
    poses = _optimised(estimates[rows], covariances[rows], trust[rows], between(path[rows[:-1]], path[rows[1:]]))
    nearest = np.maximum(np.searchsorted(rows, np.arange(len(path)), side="right") - 1, 0)
    found: Array = compose(poses[nearest], between(path[rows[nearest]], path))
    return found


def smoothed_with_lag(
    estimates: Array, covariances: Array, trust: Array, motions: Array, lag: int, window: int
) -> Array:
    """Smooths as `smoothed`, but each pose from the `window` frames up to it and `lag` frames after it.

    A run could give them `lag` frames late. NaN where none of these frames has an estimate.
    """
    found = np.full_like(estimates, np.nan)
    there: Bools = np.asarray(np.isfinite(estimates).all(axis=1))
    for frame in range(len(estimates)):
        part = slice(max(0, frame - window), frame + lag + 1)
        if there[part].any():
            poses = smoothed(estimates[part], covariances[part], trust[part], motions[part])
            found[frame] = poses[frame - part.start]
    return found


def _optimised(estimates: Array, covariances: Array, trust: Array, motions: Array) -> Array:
    number = len(estimates)
    if number == 1:
        return estimates.copy()
    variances = np.nan_to_num(np.diagonal(covariances, axis1=1, axis2=2))
    largest = np.where(trust[:, None] < 1.0, MAX_SIGMAS, np.inf)
    spread = np.clip(np.sqrt(variances), MIN_SIGMAS, largest) / np.sqrt(np.maximum(trust, MIN_TRUST))[:, None]
    drift = odometry_sigmas(motions, odometry_sigma(estimates, trust, motions))
    frames = np.arange(1, number + 1)  # pose 0 is the map's origin, from which estimates are measured
    pairs = np.column_stack([np.zeros_like(frames), frames]), np.column_stack([frames, frames + 1])[:-1]
    poses, _ = optimised_poses(
        np.concatenate([np.zeros((1, 3)), estimates]),
        np.concatenate(pairs),
        np.concatenate([estimates, motions]),
        np.concatenate([spread, drift]),
        np.concatenate([np.ones(number, np.bool_), contradicted(estimates, trust, motions)]),
    )
    return poses[1:]


def odometry_sigma(estimates: Array, trust: Array, motions: Array) -> float:
    """Standard deviation per metre of odometry `motions` (N - 1, 3), from the scale of `estimates` (N, 3) against it.

    Twice the relative error of scale (a guessed speed, another wheel) where that exceeds `OFF_SCALE`.
    """
    path = chain(np.concatenate([np.zeros((1, 3)), motions]))
    ways, driven = (between(poses[:-SPAN], poses[SPAN:])[:, :2] for poses in (estimates, path))
    squares = np.square(driven).sum(axis=1)
    asked = (trust[:-SPAN] >= 0.5) & (trust[SPAN:] >= 0.5) & (squares > 0.01)
    if asked.sum() < SPAN:
        return SIGMA_PER_METRE
    off = abs(float(np.median((ways * driven).sum(axis=1)[asked] / squares[asked])) - 1.0)
    return 2.0 * off if off > OFF_SCALE else SIGMA_PER_METRE


def contradicted(estimates: Array, trust: Array, motions: Array) -> Bools:
    """Which motions (N - 1, 3) are between stretches of trusted estimates (N, 3) that contradict odometry: (N - 1,)."""
    path = chain(np.concatenate([np.zeros((1, 3)), motions]))
    moved = compose(estimates[:-1], motions)
    jumps = _disagree(moved, estimates[1:])
    number = np.cumsum(np.concatenate([[False], jumps | ((trust[1:] >= 0.5) != (trust[:-1] >= 0.5))]))
    stretches = [np.flatnonzero(number == each) for each in np.unique(number[trust >= 0.5])]
    stretches = [stretch for stretch in stretches if len(stretch) >= STRETCH]
    doubtful = np.zeros(len(motions), np.bool_)
    for before, after in pairwise(stretches):
        there = path[after[0]]
        ahead, behind = (_carried(estimates, path, rows, there) for rows in (before[-WITNESSES:], after[:WITNESSES]))
        if _disagree(ahead[None], behind[None])[0]:
            doubtful[before[-1] : after[0]] = True
    return doubtful


def _carried(estimates: Array, path: Array, rows: Ints, there: Array) -> Array:
    """Median pose to which odometry leads from estimates: (3,)."""
    poses = compose(estimates[rows], between(path[rows], there))
    heading = np.arctan2(np.median(np.sin(poses[:, 2])), np.median(np.cos(poses[:, 2])))
    return np.array([*np.median(poses[:, :2], axis=0), heading])


def _disagree(poses: Array, others: Array) -> Bools:
    far: Bools = (position_errors(poses, others) > JUMP_M) | (heading_errors_deg(poses, others) > JUMP_DEG)
    return far

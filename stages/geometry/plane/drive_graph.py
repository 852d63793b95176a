"""Pose graphs of one or more drives: odometry along each, and pairs of views that show one place."""

import math
from typing import NamedTuple

import numpy as np

from omninav.stages.geometry.arrays import Array, Bools, Ints

from .pose_graph import optimised_poses
from .se2 import between, compose, wrap

SIGMA_PER_METRE = 0.02
"""Standard deviation of odometry per metre (m and rad)."""
TURN_SIGMA = 0.05
"""The same of a turn, per radian."""
MIN_SIGMAS = (0.005, 0.005, 0.0025)
"""Standard deviations of the shortest motion (m, m, rad): poses in a map are samples of a drive."""
MIN_CLOSURES = 3
"""Closures that agree on where a drive began, to join it to others."""
CLOSURE_SIGMA, CLOSURE_SIGMA_DEG = 0.5, 5.0
"""Standard deviations of a closure: of its position, in distances over which views change, and of its heading."""
HEADING_SCALE = math.radians(20.0)
"""Difference of heading at which closures agree half on where a drive began."""


class Closures(NamedTuple):
    """Pairs of views that show one place. `pairs` (C, 2), the earlier first; `turns` (C,): heading of the later in the
    frame of the earlier (rad)."""

    pairs: Ints
    turns: Array


def odometry_sigmas(motions: Array, per_metre: float = SIGMA_PER_METRE) -> Array:
    """Standard deviations (E, 3) of motions (E, 3) that odometry measured (m, m, rad)."""
    length = np.hypot(motions[:, 0], motions[:, 1])
    sigmas: Array = np.asarray(MIN_SIGMAS) + per_metre * length[:, None]
    sigmas[:, 2] += TURN_SIGMA * np.abs(motions[:, 2])
    return sigmas


def closure_sigmas(unit_m: float) -> tuple[float, float]:
    """Standard deviations (m, rad) of a closure between views that change over `unit_m`."""
    return CLOSURE_SIGMA * unit_m, math.radians(CLOSURE_SIGMA_DEG)


def placed_drives(own: Array, drives: Ints, closures: Closures, scale_m: float) -> tuple[Array, Bools]:
    """Poses (N, 3) of all drives in the frame of the first, and which drives (D,) closures join to it.

    `own` (N, 3): poses, each in the frame of its drive; `drives` (N,): numbers from 0. A drive is put where most of its
    closures with drives that are joined agree, to within `scale_m`; without three that do nothing joins it, and its
    poses stay.
    """
    poses, joined = own.copy(), np.arange(int(drives.max()) + 1) == 0
    one, other = closures.pairs.T
    for _ in range(len(joined)):  # a drive may be joined by a later one
        for drive in np.flatnonzero(~joined).tolist():
            forth = (drives[other] == drive) & joined[drives[one]]
            back = (drives[one] == drive) & joined[drives[other]]
            seen, known = (np.concatenate([a[forth], b[back]]) for a, b in ((other, one), (one, other)))
            turns = np.concatenate([closures.turns[forth], -closures.turns[back]])
            if not len(seen):
                continue
            here = compose(poses[known], np.column_stack([np.zeros((len(known), 2)), turns]))
            starts = compose(here, between(own[seen], np.zeros(3)))  # where the drive's frame is by each closure
            expected = compose(starts[:, None], own[seen][None])  # (hypotheses, closures)
            missed = np.hypot(expected[..., 0] - here[:, 0], expected[..., 1] - here[:, 1]) / scale_m
            turned = wrap(expected[..., 2] - here[:, 2]) / HEADING_SCALE
            apart = missed**2 + turned**2
            best = (1.0 / (1.0 + apart)).sum(axis=1).argmax()
            if (apart[best] <= 1.0).sum() < MIN_CLOSURES:
                continue
            rows = drives == drive
            poses[rows] = compose(starts[best], own[rows])
            joined[drive] = True
    return poses, joined


def straightened_drives(
    poses: Array, drives: Ints, closures: Closures, sigma_m: float, sigma_rad: float, motions: Array | None = None
) -> tuple[Array, Array]:
    """The poses (N, 3) that agree best with odometry and closures, and the weight (C,) that each closure was left.

    `poses` (N, 3): a first guess; `drives` (N,): numbers from 0, along each of which odometry measured `motions` (N, 3)
    from the pose before; None: those between the first guesses. `sigma_m`, `sigma_rad`: standard deviations of a
    closure.
    """
    later = np.flatnonzero(np.diff(drives) == 0) + 1
    steps = between(poses[later - 1], poses[later]) if motions is None else motions[later]
    loops = np.column_stack([np.zeros((len(closures.pairs), 2)), closures.turns])
    edges = np.concatenate([np.column_stack([later - 1, later]), closures.pairs])
    spread = np.tile([sigma_m, sigma_m, sigma_rad], (len(loops), 1))
    found, weights = optimised_poses(
        poses,
        edges,
        np.concatenate([steps, loops]),
        np.concatenate([odometry_sigmas(steps), spread]),
        np.arange(len(edges)) >= len(later),
    )
    return found, weights[len(later) :]

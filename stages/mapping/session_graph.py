"""The pose graph of several drives: odometry along each, and places that look alike within and between them."""

import math

import numpy as np
import numpy.typing as npt

from omninav.stages.geometry.plane.pose_graph import optimised_poses
from omninav.stages.geometry.plane.se2 import between, compose, wrap
from omninav.stages.values.sessions import Sessions

from .pose_graph_edges import Closures, odometry_sigmas

Array = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]
Bools = npt.NDArray[np.bool_]


def closures_between(sessions: Sessions, max_distance: float, min_gap_m: float, samples: int) -> Closures:
    """For each view the most alike of each earlier drive, and of its own at least `min_gap_m` metres back.

    A pair counts up to `max_distance`, in the views' unit. Of more than `samples` views so many, evenly spaced, look
    for partners.
    """
    values, drives, driven = sessions.values, sessions.drives, sessions.driven
    pairs, turns = [], []
    for query in np.unique(np.linspace(0, len(sessions) - 1, min(samples, len(sessions))).astype(np.int64)).tolist():
        view = sessions.view(query)
        distances = view.distances(values[:query])
        distances[(drives[:query] == drives[query]) & (driven[:query] > driven[query] - min_gap_m)] = math.inf
        best = [
            int(rows[distances[rows].argmin()])
            for drive in range(drives[query] + 1)
            if len(rows := np.flatnonzero(drives[:query] == drive))
        ]
        near = np.array([row for row in best if distances[row] <= max_distance], np.int64)
        if len(near):
            pairs += [(row, query) for row in near.tolist()]
            turns += view.turns(values[near]).tolist()
    return Closures(np.array(pairs, np.int64).reshape(-1, 2), np.array(turns))


def placed(sessions: Sessions, closures: Closures, scale_m: float) -> tuple[Array, Bools]:
    """A first guess of all poses (N, 3), and which drives are joined to the first by closures.

    The first drive begins at the pose that was believed there. Each later one is put where most of its closures with
    drives that are joined agree, to within `scale_m`; without three of them nothing joins it.
    """
    own, drives = sessions.by_odometry, sessions.drives
    poses = own.copy()
    joined = np.zeros(int(drives[-1]) + 1, np.bool_)
    joined[0] = True
    for drive in range(len(joined)):
        rows = drives == drive
        if drive == 0:
            poses[rows] = compose(sessions.believed[0], own[rows])
            continue
        known, seen = closures.pairs.T
        usable = (drives[seen] == drive) & joined[drives[known]] & (drives[known] != drive)
        here = compose(poses[known[usable]], np.column_stack([np.zeros((usable.sum(), 2)), closures.turns[usable]]))
        starts = compose(here, between(own[seen[usable]], np.zeros(3)))  # where the drive began, each closure thinks
        if len(starts) >= 3:
            expected = compose(starts[:, None], own[seen[usable]][None])  # (hypotheses, closures)
            missed = np.hypot(expected[..., 0] - here[:, 0], expected[..., 1] - here[:, 1]) / scale_m
            turned = wrap(expected[..., 2] - here[:, 2]) / math.radians(20.0)
            agreed = 1.0 / (1.0 + missed**2 + turned**2)
            poses[rows] = compose(starts[agreed.sum(axis=1).argmax()], own[rows])
            joined[drive] = True
    return poses, joined


def straightened_poses(
    sessions: Sessions, closures: Closures, start: Array, sigma_m: float, sigma_rad: float
) -> tuple[Array, Array]:
    """The poses (N, 3) that agree best with odometry and closures, and the weight (C,) that each closure was left.

    `start` (N, 3): a first guess. `sigma_m`, `sigma_rad`: standard deviations of a closure.
    """
    steps = np.flatnonzero(~sessions.begins)
    loops = np.column_stack([np.zeros((len(closures.pairs), 2)), closures.turns])
    edges = np.concatenate([np.column_stack([steps - 1, steps]), closures.pairs])
    measured = np.concatenate([sessions.motions[steps], loops])
    sigmas = np.concatenate(
        [odometry_sigmas(sessions.motions[steps]), np.tile([sigma_m, sigma_m, sigma_rad], (len(loops), 1))]
    )
    poses, weights = optimised_poses(start, edges, measured, sigmas, np.arange(len(edges)) >= len(steps))
    return poses, weights[len(steps) :]

"""Error at a place by the odometry of its first visit, and by the number of visits."""

from typing import Any

import numpy as np

from omninav.pipeline import Context, Metrics, MetricStage
from omninav.stages.geometry.arrays import Array, Ints
from omninav.stages.geometry.plane.pose_errors import position_errors
from omninav.stages.values.drive import Drive, known

PLACE_M = 1.0
"""Side of a place's cell, metres."""
AWAY_M = 5.0
"""True path length since the robot was last in the cell, beyond which it comes for another visit, metres."""


class RevisitError(MetricStage):
    """Compares errors at a place's later visits with its first one, over all logs that have ground truth.

    A place is a square cell of the floor, by true positions; a visit ends where the robot has driven `AWAY_M` since it
    was last in the cell, or where a log ends. Porta & Kröse 2004, section 5, and Gross, Koenig & Müller 2005, section
    3, state of a map that is learned while it is used that its error at a place is that of the odometry of the first
    visit.

    `visits`, over the places that were visited at least as often as half of all places, so that every entry is of the
    same ones: lists with an entry for each number of visits, `number` (1: the first) and `position_error_m`, the mean
    over the places of the error at that visit; `places`, how many there are. `first_visits`, over the places that were
    visited again: `places`, how many; `odometry_error_m`, the mean error of odometry alone at their first visits;
    `position_error_m`, that of the estimate at all later ones; `ratio`, the second over the first; `correlation` of the
    two over the places (None where one of them does not vary). Odometry alone starts at each log's first true pose and
    is not aligned.
    """

    def step(self, ctx: Context, drive: Drive) -> MetricStage.Out:
        logs = [log for log in drive.by_log if log.has_truth]
        rows = [known(log.truth) & known(log.estimate) for log in logs]
        scored = [log.at(each) for log, each in zip(logs, rows, strict=True)]
        if not sum(map(len, scored)):
            return self.Out(metrics=Metrics({}))
        truth = np.concatenate([log.truth for log in scored])
        errors = np.concatenate([position_errors(log.estimate, log.truth) for log in scored])
        odometry = np.concatenate([odometry_errors(log)[each] for log, each in zip(logs, rows, strict=True)])
        cells = np.unique(np.floor(truth[:, :2] / PLACE_M).astype(np.int64), axis=0, return_inverse=True)[1]
        numbers = visit_numbers(cells.ravel(), driven_between(scored), AWAY_M)
        values: dict[str, Any] = {"visits": over_visits(cells.ravel(), numbers, errors)}
        found = first_against_later(cells.ravel(), numbers, errors, odometry)
        return self.Out(metrics=Metrics(values | ({"first_visits": found} if found else {})))


def odometry_errors(log: Drive) -> Array:
    """Position errors of odometry alone in a log's frames: (N,), NaN without truth or without odometry."""
    path = log.odometry_alone()
    return position_errors(np.full_like(log.truth, np.nan) if path is None else path, log.truth)


def driven_between(logs: list[Drive]) -> Array:
    """True path (m) that led to each frame from the one before, infinite at the first frame of a log: (N,)."""
    ways = [np.concatenate([[np.inf], np.hypot(*np.diff(log.truth[:, :2], axis=0).T)])[: len(log)] for log in logs]
    return np.concatenate(ways)


def visit_numbers(cells: Ints, ways: Array, away_m: float) -> Ints:
    """The number of the visit that each frame belongs to, from 1, of its cell (N,): (N,)."""
    numbers: list[int] = []
    last_m: dict[int, float] = {}
    count: dict[int, int] = {}
    along = np.cumsum(np.minimum(ways, away_m + 1.0))  # between two logs the robot has been away from everywhere
    for cell, driven in zip(cells.tolist(), along.tolist(), strict=True):
        if cell not in last_m or driven - last_m[cell] > away_m:
            count[cell] = count.get(cell, 0) + 1
        last_m[cell] = driven
        numbers.append(count[cell])
    return np.array(numbers, np.int64)


def over_visits(cells: Ints, numbers: Ints, errors: Array) -> dict[str, Any]:
    """Table `visits`, of frames (N,) with their cell (0, 1, 2 …), the number of the visit and the error."""
    shape = int(cells.max()) + 1, int(numbers.max())
    frames, summed = np.zeros(shape, np.int64), np.zeros(shape)
    np.add.at(frames, (cells, numbers - 1), 1)
    np.add.at(summed, (cells, numbers - 1), errors)
    visited = (frames > 0).sum(axis=1)
    often = int(np.median(visited))
    same = visited >= often
    means = summed[same, :often] / frames[same, :often]
    return {
        "number": list(range(1, often + 1)),
        "position_error_m": means.mean(axis=0).tolist(),
        "places": int(same.sum()),
    }


def first_against_later(cells: Ints, numbers: Ints, errors: Array, odometry: Array) -> dict[str, Any]:
    """Table `first_visits`; empty where no place was visited again, or without odometry."""
    again = np.unique(cells[numbers > 1])
    if not len(again) or not np.isfinite(odometry).all():
        return {}
    before = np.array([odometry[(cells == cell) & (numbers == 1)].mean() for cell in again])
    after = np.array([errors[(cells == cell) & (numbers > 1)].mean() for cell in again])
    varied = len(again) > 2 and np.ptp(before) > 0.0 and np.ptp(after) > 0.0
    return {
        "places": len(again),
        "odometry_error_m": float(before.mean()),
        "position_error_m": float(after.mean()),
        "ratio": float(after.mean() / before.mean()) if before.mean() > 0.0 else None,
        "correlation": float(np.corrcoef(before, after)[0, 1]) if varied else None,
    }

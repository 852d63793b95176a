"""Growth of a map of views, and what odometry put into it at first."""

from collections.abc import Sequence
from typing import Annotated, Any

import numpy as np

from omninav.pipeline import Bounds, Context, Metrics, MetricSpec, MetricStage
from omninav.stages.geometry.arrays import Array, Ints
from omninav.stages.geometry.plane.pose_errors import heading_errors_deg, position_errors
from omninav.stages.geometry.plane.se2 import path_length
from omninav.stages.values.drive import Drive, known
from omninav.stages.values.view_mixtures import ViewEvent

from .error_curves import HOME_M, lap_ends
from .trajectory_errors import spread

SPECS = {
    "map.inserted": MetricSpec(title="References added"),
    "map.removed": MetricSpec(title="References removed"),
    "map.new_after_first_lap_rate": MetricSpec(title="References added after the first lap", better="lower"),
}


class MapHistory(MetricStage):
    """Counts references added and removed, and measures the odometry drift while the first of them were learned.

    A reference is added in the frame in which it was seen, however much later it is learned, and removed in the frame
    in which the map forgets it; `references` and `components` are those the map has after a frame. What is learned once
    the last log has ended, `after_last`, counts to the last frame.

    Under `map`: `inserted`, `removed`; `new_after_first_lap_rate`, what came after the first lap over what had come by
    its end. `map_over_steps`: lists over the frames of all logs: `step`, and `references`, `components`, `inserted`,
    `removed` so far. `map_per_lap`: lists with an entry for each lap of the first log and for each later log: the same
    counts, of that part alone. `first_map`: the drift that odometry put into it up to the last new ground of the first
    log: `frames`, `driven_m`, and of `odometry_alone` (from the first true pose, unaligned) and of the `estimate` the
    errors over it and how far off each ended. Laps are those of `ErrorCurves`. Without ground truth there are no laps
    and no errors.
    """

    points: Annotated[int, Bounds(ge=1)] = 60
    """Length of the lists of `map_over_steps`."""

    def step(
        self,
        ctx: Context,
        drive: Drive,
        events: Sequence[ViewEvent | None],
        after_last: ViewEvent | None = None,
    ) -> MetricStage.Out:
        logs = drive.by_log
        counts = counted(events, after_last)
        if not len(counts):
            return self.Out(metrics=Metrics({}))
        parts = parts_of(logs)
        came, went = (np.diff(column, prepend=0) for column in counts[:, 2:].T)
        ends = np.cumsum(parts) - 1
        starts = ends - parts + 1
        first = counts[ends[0], 2]
        steps = np.unique(np.linspace(0, len(counts) - 1, min(self.points, len(counts))).round().astype(np.int64))
        values: dict[str, Any] = {
            "map": {
                "inserted": int(counts[-1, 2]),
                "removed": int(counts[-1, 3]),
                "new_after_first_lap_rate": float((counts[-1, 2] - first) / first) if first and len(ends) > 1 else None,
            },
            "map_over_steps": {"step": steps.tolist(), **_columns(counts[steps])},
            "map_per_lap": {
                "frames": parts.tolist(),
                **_columns(counts[ends]),
                "inserted": [int(came[a : b + 1].sum()) for a, b in zip(starts, ends, strict=True)],
                "removed": [int(went[a : b + 1].sum()) for a, b in zip(starts, ends, strict=True)],
            },
        }
        if logs[0].has_truth:
            values["first_map"] = first_map(logs[0])
        return self.Out(metrics=Metrics(values, SPECS, details=("first_map",)))


def counted(events: Sequence[ViewEvent | None], after_last: ViewEvent | None = None) -> Ints:
    """References and components after each tick, and how many references had been seen and had gone by then: (N, 4).

    What a known map held is taken from the first event. `after_last`: what was learned after the last tick.
    """
    known_events = [(row, event) for row, event in enumerate(events) if event is not None]
    if after_last is not None and events:
        known_events.append((len(events) - 1, after_last))
    if not known_events:
        return np.zeros((len(events), 4), np.int64)
    rows = np.array([row for row, _ in known_events])
    first = known_events[0][1]
    known = first.views - len(first.inserted) + len(first.removed)
    held = np.array([(known, first.components if known else 0), *((e.views, e.components) for _, e in known_events)])
    came = np.bincount(np.concatenate([event.seen for _, event in known_events]), minlength=len(events))
    went = np.bincount(rows, [len(event.removed) for _, event in known_events], len(events))
    latest = np.searchsorted(rows, np.arange(len(events)), side="right")
    return np.column_stack([held[latest], came.cumsum(), went.cumsum()]).astype(np.int64)


def parts_of(logs: Sequence[Drive]) -> Ints:
    """Number of frames of each lap of the first log, and of each later log."""
    first = logs[0]
    rows = np.flatnonzero(known(first.truth))
    ends = lap_ends(first.truth[rows], first.truth[rows[0]]) if len(rows) else []
    laps = np.diff([0, *rows[ends].tolist(), len(first)])
    return np.concatenate([laps, [len(log) for log in logs[1:]]]).astype(np.int64)


def last_new_ground(path: Array) -> int:
    """The last row of a path (N, 2) at a place that it had not been to: within `HOME_M`, and left beyond twice that."""

    def is_new(row: int) -> bool:
        away = np.hypot(*(path[:row] - path[row]).T)
        left = np.flatnonzero(away > 2.0 * HOME_M)
        return not len(left) or bool((away[: left[-1]] > HOME_M).all())

    return next(row for row in reversed(range(len(path))) if is_new(row))


def first_map(drive: Drive) -> dict[str, Any]:
    """Errors of odometry alone and of the estimate up to the last new ground of a drive that has ground truth."""
    rows = np.flatnonzero(known(drive.truth))
    frames = int(rows[last_new_ground(drive.truth[rows, :2])]) + 1
    scored = (known(drive.truth) & known(drive.estimate))[:frames]
    truth = drive.truth[:frames][scored]
    if not len(truth):
        return {}
    found: dict[str, Any] = {"frames": frames, "driven_m": path_length(truth)}
    for name, poses in (("odometry_alone", drive.odometry_alone()), ("estimate", drive.estimate)):
        if poses is not None:
            found[name] = _errors(poses[:frames][scored], truth)
    return found


def _errors(poses: Array, truth: Array) -> dict[str, Any]:
    metres, degrees = position_errors(poses, truth), heading_errors_deg(poses, truth)
    return {
        "position_error_m": spread(metres),
        "heading_error_deg": spread(degrees),
        "final_error_m": float(metres[-1]),
        "final_heading_error_deg": float(degrees[-1]),
    }


def _columns(counts: Ints) -> dict[str, list[int]]:
    return {
        name: column.tolist()
        for name, column in zip(("references", "components", "inserted", "removed"), counts.T, strict=True)
    }

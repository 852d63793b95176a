"""Drives made of rows of numbers, and the figures that a metric finds of them."""

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from small_run import collected

from omninav.pipeline import Context, Tick
from omninav.stages.values.belief import PoseEstimate
from omninav.stages.values.drive import Drive
from omninav.stages.values.pose import Motion, Pose

Row = Sequence[float] | np.ndarray | None
"""x (m), y (m) and heading (rad), or nothing."""
AT_ORIGIN = (0.0, 0.0, 0.0)


def on_x(xs: Iterable[float | None], y: float = 0.0) -> list[Row]:
    """Rows along x, looking ahead; None stays None."""
    return [None if x is None else (x, y, 0.0) for x in xs]


def seen_at(row: Row, weight: float = 1.0) -> PoseEstimate | None:
    """An estimate whose mean is its pose, with a standard deviation of 1 in everything."""
    if row is None:
        return None
    pose = Pose(*map(float, row))
    return PoseEstimate(pose, np.eye(3), weight, pose)


def made_drive(
    truth: Iterable[Row],
    believed: Iterable[Row] | None = None,
    motion: Iterable[Row] | None = None,
    logs: Sequence[int] | None = None,
    every_s: float = 1.0,
    **given: Any,
) -> Drive:
    """A drive with a row a tick; `given`: what else `collected` takes. All ticks are of one log unless `logs` says."""
    poses = [None if row is None else Pose(*map(float, row)) for row in truth]
    logs = logs or [0] * len(poses)
    ticks = [
        Tick(n, round(n * every_s * 1e9), log, logs[:n].count(log), log not in logs[:n]) for n, log in enumerate(logs)
    ]
    if believed is not None:
        given["estimates"] = [seen_at(row) for row in believed]
    moved = None if motion is None else [None if row is None else Motion(*map(float, row)) for row in motion]
    return collected(ticks, poses, moved, **given)


def figures(stage: Any, *given: Any, **more: Any) -> Any:
    """Gives the figures that a metric finds, or None."""
    metrics = stage.step(Context("metric"), *given, **more).metrics
    return metrics and metrics.values

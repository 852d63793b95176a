"""Frames of snapshots: more of them at the beginning of a drive, where a filter converges."""

import numpy as np


def is_snapshot_frame(frame: int) -> bool:
    """Frames 0, 1, 2, 5, 10, 20, 50, 100, …: known while the drive is still going on."""
    while frame >= 10 and frame % 10 == 0:
        frame //= 10
    return frame in (0, 1, 2, 5)


def geometric_steps(frames: int, wanted: int) -> list[int]:
    """Up to `wanted` indices from 0 to frames - 1, both included, that grow by a constant factor (0, 1, 3, 8, …)."""
    if frames <= 0:
        return []
    steps = np.geomspace(1, frames, wanted) if wanted > 1 else np.array([1.0])
    return sorted({round(step) - 1 for step in steps.tolist()})


def spread_out(count: int, wanted: int) -> list[int]:
    """Up to `wanted` indices spread evenly over `count` things, the first and the last included."""
    return sorted({round(i) for i in np.linspace(0, count - 1, min(count, wanted)).tolist()}) if count else []

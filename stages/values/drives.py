"""What was collected over a run, as arrays: one drive per log."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from omninav.pipeline import Tick
from omninav.stages.geometry.plane.se2 import between, chain, compose

from .belief import PoseEstimate
from .pose import Motion, Pose

Array = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Drive:
    """One log's frames. Poses are (N, 3) x, y (m), heading (rad) in the map frame; rows of NaN where there was none.

    `frames`: the frame's number in its log. `stamps`: header stamps (ns). `estimate`: the belief's heaviest mode,
    `mean` the whole belief's mean. `truth`: ground truth. `motion`: SE(2) increment since the frame before.
    """

    log: int
    frames: npt.NDArray[np.int64]
    stamps: npt.NDArray[np.int64]
    estimate: Array
    covariance: Array
    mean: Array
    truth: Array
    motion: Array

    def __len__(self) -> int:
        return len(self.frames)

    @property
    def seconds(self) -> Array:
        """Time since the first frame (s)."""
        seconds: Array = (self.stamps - self.stamps[0]) / 1e9
        return seconds

    @property
    def has_truth(self) -> bool:
        """Whether any frame has a true pose."""
        return bool(known(self.truth).any())

    def odometry(self) -> Array | None:
        """Motions one after another, from the origin at the first frame; (N, 3), None where there is no motion.

        A frame whose motion is absent did not move.
        """
        if not known(self.motion).any():
            return None
        moved = np.nan_to_num(self.motion)
        moved[0] = 0.0
        return chain(moved)

    def odometry_alone(self) -> Array | None:
        """Where odometry alone would have led, from the first true pose on; (N, 3), None where there is no motion.

        Without any truth the path is laid through the last estimate, so that its shape can be compared.
        """
        path = self.odometry()
        if path is None:
            return None
        if self.has_truth:
            anchor, at = int(np.argmax(known(self.truth))), self.truth
        elif known(self.estimate).any():
            anchor, at = len(self) - 1 - int(np.argmax(known(self.estimate)[::-1])), self.estimate
        else:
            return path
        return compose(at[anchor], between(path[anchor], path))


def known(poses: Array) -> npt.NDArray[np.bool_]:
    """Which rows of (N, 3) poses are there: (N,)."""
    return np.asarray(np.isfinite(poses).all(axis=1))


def drives(
    ticks: Sequence[Tick],
    estimates: Sequence[PoseEstimate | None],
    truth: Sequence[Pose | None],
    motion: Sequence[Motion | None],
) -> list[Drive]:
    """Collected sequences, one entry per tick, cut into drives at the logs' boundaries. Each is read once, in order."""
    logs: dict[int, list[int]] = {}
    entries = []
    for row, (tick, estimate, true, moved) in enumerate(zip(ticks, estimates, truth, motion, strict=True)):
        logs.setdefault(tick.log, []).append(row)
        entries.append(
            (
                tick.frame,
                tick.stamp,
                pose_row(estimate.pose if estimate else None),
                np.full((3, 3), np.nan) if estimate is None else estimate.covariance,
                pose_row(estimate.mean if estimate else None),
                pose_row(true),
                (np.nan,) * 3 if moved is None else (moved.x, moved.y, moved.turn),
            )
        )
    found = []
    for log, rows in logs.items():
        frames, stamps, pose, covariance, mean, true_pose, steps = zip(*(entries[row] for row in rows), strict=True)
        found.append(
            Drive(
                log=log,
                frames=np.array(frames, dtype=np.int64),
                stamps=np.array(stamps, dtype=np.int64),
                estimate=np.array(pose, dtype=np.float64),
                covariance=np.array(covariance, dtype=np.float64),
                mean=np.array(mean, dtype=np.float64),
                truth=np.array(true_pose, dtype=np.float64),
                motion=np.array(steps, dtype=np.float64),
            )
        )
    return found


def pose_row(pose: Pose | None) -> tuple[float, float, float]:
    """A pose as x, y (m), heading (rad); NaN where there is none."""
    return (np.nan,) * 3 if pose is None else (pose.x, pose.y, pose.heading)


def pose_rows(poses: Sequence[Pose | None]) -> Array:
    """Poses as rows (N, 3) of x, y (m), heading (rad); NaN where there is none."""
    return np.array([pose_row(pose) for pose in poses], dtype=np.float64).reshape(-1, 3)

"""A whole drive as arrays: a row for every tick."""

import dataclasses
from collections.abc import Sequence

import numpy as np

from omninav.pipeline import Value
from omninav.stages.geometry.arrays import Array, Bools, Ints
from omninav.stages.geometry.plane.se2 import between, chain, compose

from .evidence import ImageEvidence
from .pose import Pose

EVIDENCE = tuple(each.name for each in dataclasses.fields(ImageEvidence) if each.name != "conflict")
"""Columns of a drive's evidence: the numbers of `ImageEvidence`."""


class Drive(Value):
    """The N ticks of a run, or of one of its logs, a row each.

    Poses are (N, 3) x, y (m), heading (rad) in the map frame; a row is NaN where there was none.
    """

    row: Ints
    """Number of the tick within the run: the index into whatever else was collected."""
    log: Ints
    """Number of the log."""
    frames: Ints
    """Number of the frame within its log."""
    stamps: Ints
    """Header stamps (ns)."""
    estimate: Array
    """The belief's heaviest mode."""
    covariance: Array
    """Covariance of that mode (N, 3, 3), widened where the graph has `WidenCovariance`."""
    mode_weight: Array
    """Share of that mode in the belief; 0 where there is none."""
    mean: Array
    """Mean of the whole belief."""
    truth: Array
    """Ground truth."""
    motion: Array
    """SE(2) increment since the frame before."""
    collisions: Ints
    """Contacts of a simulated robot so far."""
    distance: Array
    """Metres that a simulated robot has driven so far; NaN in a recorded log."""
    place: Ints
    """The believed place of a topological map; -1 where there is none."""
    reference: Ints
    """The reference, view or place of the map that looked most like the image; -1 where there is none."""
    similarity: Array
    """Its similarity to the image in [0, 1], 1 is equal; NaN where there is none."""
    visual_distance: Array
    """Its distance to the image in the unit of the comparison, 0 is equal; NaN where there is none."""
    reference_turn: Array
    """Turn of the robot against it (rad, counter-clockwise); NaN where there is none."""
    confidence: Array
    """Probability that the estimate is right, by a monitor; NaN where there is none."""
    evidence: Array
    """Evidence of each image on the estimate (N, `EVIDENCE`); NaN where there is none."""
    state: Ints
    """Which of `TRACKING_STATES` it is in, by a monitor; -1 where there is none."""
    conflict: Ints
    """Which of `conflicts` held first at each image; -1 where none did."""
    conflicts: tuple[str, ...]
    """Findings of inputs that do not fit each other."""

    def __len__(self) -> int:
        return len(self.row)

    def at(self, rows: Bools | Ints | slice) -> "Drive":
        """Some of the rows."""
        named = {field.name: getattr(self, field.name) for field in dataclasses.fields(self)}
        return dataclasses.replace(self, **{name: rowed[rows] for name, rowed in named.items() if name != "conflicts"})

    @property
    def by_log(self) -> list["Drive"]:
        """The logs, in their order."""
        return [self.at(self.log == log) for log in dict.fromkeys(self.log.tolist())]

    @property
    def last_log(self) -> "Drive":
        """The last log; empty where there is none."""
        return self.at(self.log == self.log[-1]) if len(self) else self

    @property
    def seconds(self) -> Array:
        """Time since the first row (s)."""
        seconds: Array = (self.stamps - self.stamps[:1]) / 1e9
        return seconds

    @property
    def has_truth(self) -> bool:
        """Tells whether any row has a true pose."""
        return bool(known(self.truth).any())

    def odometry(self) -> Array | None:
        """Motions of one log one after another, from the origin at its first frame; (N, 3), None without any motion.

        A frame whose motion is absent did not move.
        """
        if not known(self.motion).any():
            return None
        moved = np.nan_to_num(self.motion)
        moved[0] = 0.0
        return chain(moved)

    def odometry_alone(self) -> Array | None:
        """Path by odometry alone in one log, from the first true pose on; (N, 3), None without any motion.

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


def known(poses: Array) -> Bools:
    """Which rows of (N, 3) poses are there: (N,)."""
    return np.asarray(np.isfinite(poses).all(axis=1))


def pose_row(pose: Pose | None) -> tuple[float, float, float]:
    """A pose as x, y (m), heading (rad); NaN where there is none."""
    return (np.nan,) * 3 if pose is None else (pose.x, pose.y, pose.heading)


def pose_rows(poses: Sequence[Pose | None]) -> Array:
    """Poses as rows (N, 3) of x, y (m), heading (rad); NaN where there is none."""
    return np.array([pose_row(pose) for pose in poses], dtype=np.float64).reshape(-1, 3)

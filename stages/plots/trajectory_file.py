"""Trajectories in the TUM format, which evo and others read."""

from pathlib import Path
from typing import Literal

import numpy as np

from omninav.pipeline import Context, Stage, write_whole
from omninav.stages.geometry.arrays import Array
from omninav.stages.values.drive import Drive, known


class TrajectoryFile(Stage):
    """Writes `trajectory.tum`, a row per image: header stamp (s), x y z (m), quaternion qx qy qz qw; map frame.

    With several logs there is a `trajectory_<n>.tum` for each, and `trajectory.tum` is the last. Frames without an
    estimate have no row and are counted. `truth.tum` is the same of the true poses that are known: `evo_ape tum
    truth.tum trajectory.tum --align`.
    """

    name: str = "trajectory"
    """The file's name without its ending."""
    truth: str | None = "truth"
    """The same of the file of true poses; null: none."""

    def step(self, ctx: Context, drive: Drive) -> None:
        for log in drive.by_log:
            for frame in log.frames[~known(log.estimate)]:
                ctx.count("frame_without_estimate", detail=f"frame {frame} of log {log.log[0]} has no estimate")
        if len(drive) and not known(drive.estimate).any():
            ctx.warn("no image has an estimate: see `dropped` in manifest.json for the stages that were skipped")
        if ctx.folder is None:
            return
        _write(ctx.folder, self.name, drive, "estimate")
        if self.truth is not None and drive.has_truth:
            _write(ctx.folder, self.truth, drive, "truth")


def _write(folder: Path, name: str, drive: Drive, column: Literal["estimate", "truth"]) -> None:
    texts = {}
    for log in drive.by_log:
        poses = getattr(log, column)
        there = known(poses)
        texts[int(log.log[0])] = "".join(map(tum_row, log.stamps[there].tolist(), poses[there]))
    for number, text in texts.items():
        if len(texts) > 1:
            write_whole(folder / f"{name}_{number}.tum", text)
    write_whole(folder / f"{name}.tum", texts[max(texts)] if texts else "")


def tum_row(stamp: int, pose: Array) -> str:
    """One line of a TUM file: `stamp` in nanoseconds is written in seconds with all its digits."""
    x, y, heading = pose.tolist()
    numbers = (x, y, 0.0, 0.0, 0.0, float(np.sin(heading / 2)), float(np.cos(heading / 2)))
    return f"{stamp // 10**9}.{stamp % 10**9:09d} " + " ".join(f"{number:.9f}" for number in numbers) + "\n"

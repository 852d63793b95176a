"""Trajectories in the TUM format, which evo and others read."""

from collections.abc import Sequence

import numpy as np

from omninav.pipeline import Context, Outputs, Stage, Tick
from omninav.pipeline.files import write_whole
from omninav.stages.values.belief import PoseEstimate
from omninav.stages.values.pose import Pose


class TrajectoryFile(Stage):
    """Writes `trajectory.tum`, a row per image: header stamp (s), x y z (m), quaternion qx qy qz qw; map frame.

    With several logs there is a `trajectory_<n>.tum` for each, and `trajectory.tum` is the last. Frames without an
    estimate have no row and are counted.
    """

    class Out(Outputs):
        """Nothing: the files are the result."""

    def step(self, ctx: Context, ticks: Sequence[Tick], estimates: Sequence[PoseEstimate | None]) -> Out:
        """The whole run at once."""
        logs: dict[int, list[str]] = {}
        for tick, estimate in zip(ticks, estimates, strict=True):
            rows = logs.setdefault(tick.log, [])
            if estimate is None:
                ctx.count("frame_without_estimate", detail=f"frame {tick.frame} of log {tick.log} has no estimate")
            else:
                rows.append(tum_row(tick.stamp, estimate.pose))
        if ctx.folder is not None:
            for log, rows in logs.items():
                if len(logs) > 1:
                    write_whole(ctx.folder / f"trajectory_{log}.tum", "".join(rows))
            write_whole(ctx.folder / "trajectory.tum", "".join(logs[max(logs)]) if logs else "")
        return self.Out()


def tum_row(stamp: int, pose: Pose) -> str:
    """One line of a TUM file: `stamp` in nanoseconds is written in seconds with all its digits."""
    half = pose.heading / 2
    numbers = (pose.x, pose.y, 0.0, 0.0, 0.0, float(np.sin(half)), float(np.cos(half)))
    return f"{stamp // 10**9}.{stamp % 10**9:09d} " + " ".join(f"{number:.9f}" for number in numbers) + "\n"

"""Trajectories in the TUM format, which evo and others read."""

import numpy as np

from omninav.pipeline import Context, Stage
from omninav.pipeline.files import write_whole
from omninav.stages.values.drive import Array, Drive, known


class TrajectoryFile(Stage):
    """Writes `trajectory.tum`, a row per image: header stamp (s), x y z (m), quaternion qx qy qz qw; map frame.

    With several logs there is a `trajectory_<n>.tum` for each, and `trajectory.tum` is the last. Frames without an
    estimate have no row and are counted.
    """

    name: str = "trajectory"
    """The file's name without its ending."""

    def step(self, ctx: Context, drive: Drive) -> None:
        """The whole run at once."""
        logs = {}
        for log in drive.by_log:
            number, estimated = int(log.log[0]), known(log.estimate)
            for frame in log.frames[~estimated]:
                ctx.count("frame_without_estimate", detail=f"frame {frame} of log {number} has no estimate")
            rows = zip(log.stamps[estimated].tolist(), log.estimate[estimated], strict=True)
            logs[number] = "".join(tum_row(stamp, pose) for stamp, pose in rows)
        if ctx.folder is not None:
            for number, text in logs.items():
                if len(logs) > 1:
                    write_whole(ctx.folder / f"{self.name}_{number}.tum", text)
            write_whole(ctx.folder / f"{self.name}.tum", logs[max(logs)] if logs else "")


def tum_row(stamp: int, pose: Array) -> str:
    """One line of a TUM file: `stamp` in nanoseconds is written in seconds with all its digits."""
    x, y, heading = pose.tolist()
    numbers = (x, y, 0.0, 0.0, 0.0, float(np.sin(heading / 2)), float(np.cos(heading / 2)))
    return f"{stamp // 10**9}.{stamp % 10**9:09d} " + " ".join(f"{number:.9f}" for number in numbers) + "\n"

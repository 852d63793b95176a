"""The run as a log of ROS 2 messages, for Foxglove, rosbags and whoever else reads MCAP."""

from collections.abc import Sequence
from importlib.resources import files
from typing import Any

import numpy as np
import numpy.typing as npt

from omninav.pipeline import Context, Outputs, Stage
from omninav.pipeline.files import write_whole
from omninav.pipeline.mcap.writer import LogWriter
from omninav.stages.recordings.pose_messages import path_message
from omninav.stages.values.drive import Array, Drive, known
from omninav.stages.values.map_places import AnyMap
from omninav.stages.values.ros_messages import RosMessages

from .markers import map_markers
from .result_messages import VIEWS

LAYOUT = "foxglove_layout.json"
PATH_POSES = 10_000
"""Most poses in a path; of a longer one every second is kept, every third, …"""


class ResultLog(Stage):
    """Writes `result.mcap`: the messages of every tick (see `ResultMessages`), and what is known at the end.

    That is, in the map frame, per log: `/estimate/path`, its estimates (at most 10,000), and `/odometry/path`, where
    odometry alone would have led from the first true pose (without any, through the last estimate); and `/map` as it
    was left.
    Beside it stands `foxglove_layout.json`, a layout of Foxglove's panels for these topics.
    """

    class Out(Outputs):
        """Nothing: the files are the result."""

    def step(self, ctx: Context, drive: Drive, messages: Sequence[RosMessages], map: AnyMap | None = None) -> Out:
        """The whole run at once."""
        if ctx.folder is None:
            return self.Out()
        with LogWriter(ctx.folder / "result.mcap") as log:
            ended = {int(part.row[-1]): part for part in drive.by_log}
            every = messages[-1].views_every if messages else 1  # the last knows how long the run was
            for row, tick in enumerate(messages):
                shown = tick.without(VIEWS) if row % every else tick
                for topic, msgtype, data in zip(shown.topics, shown.types, shown.data, strict=True):
                    log.append(topic, msgtype, tick.stamp, data)
                if row in ended:
                    _write_paths(log, ended[row])
            if map is not None and len(map) and len(drive):
                stamp = int(drive.stamps[-1])
                log.write("/map", "visualization_msgs/msg/MarkerArray", stamp, map_markers(map, stamp))
        write_whole(ctx.folder / LAYOUT, files(__package__).joinpath(LAYOUT).read_text(encoding="utf-8"))
        return self.Out()


def _write_paths(log: LogWriter, drive: Drive) -> None:
    """The paths of one log, at its end."""
    last, has_estimate = int(drive.stamps[-1]), known(drive.estimate)
    if has_estimate.any():
        path = _path(drive.stamps[has_estimate], drive.estimate[has_estimate], last)
        log.write("/estimate/path", "nav_msgs/msg/Path", last, path)
    alone = drive.odometry_alone()
    if alone is not None:
        log.write("/odometry/path", "nav_msgs/msg/Path", last, _path(drive.stamps, alone, last))


def _path(stamps: npt.NDArray[np.int64], poses: Array, now: int) -> dict[str, Any]:
    every = -(-len(poses) // PATH_POSES)
    return path_message(stamps[::every].tolist(), poses[::every], now)

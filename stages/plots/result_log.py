"""The run as a log of ROS 2 messages, for Foxglove, rosbags and other readers of MCAP."""

from collections.abc import Sequence
from importlib.resources import files

from omninav.pipeline import Context, Stage, write_whole
from omninav.pipeline.mcap.writer import LogStream, written_log
from omninav.stages.geometry.arrays import Array, Ints
from omninav.stages.plots.pose_messages import path_bytes
from omninav.stages.values.drive import Drive, known
from omninav.stages.values.map_places import AnyMap

from .markers import map_markers
from .show_tick import ShownTick
from .tick_messages import PathSoFar, by_tick, tick_messages

LAYOUT = "foxglove_layout.json"
BLOCK = 128
"""Ticks whose messages are made together."""
PATH_POSES = 10_000
"""Most poses in a path; of a longer one every second is kept, every third, …"""


class ResultLog(Stage):
    """Writes `result.mcap`: the messages of every tick (see `ResultMessages`), and what is known at the end.

    That is, in the map frame, per log: `/estimate/path`, its estimates (at most 10,000), and `/odometry/path`, where
    odometry alone would have led from the first true pose (without any, through the last estimate); and `/map` as it
    was left.
    Beside it is `foxglove_layout.json`, a layout of Foxglove's panels for these topics.
    """

    def step(self, ctx: Context, drive: Drive, shown: Sequence[ShownTick], map: AnyMap | None = None) -> None:
        if ctx.folder is None:
            return
        with written_log(ctx.folder / "result.mcap") as log:
            ended = {int(part.row[-1]): part for part in drive.by_log}
            every = shown[-1].views_every if shown else 1  # the last knows how long the run was
            before = PathSoFar()
            for start in range(0, len(shown), BLOCK):
                ticks = [
                    tick.without_views() if row % every else tick
                    for row, tick in enumerate(shown[start : start + BLOCK], start)
                ]
                made_of = by_tick(tick_messages(ticks, before, every), len(ticks))
                for row, (tick, made) in enumerate(zip(ticks, made_of, strict=True), start):
                    for topic, msgtype, data in made:
                        log.append(topic, msgtype, tick.tick.stamp, data)
                    if row in ended:
                        _write_paths(log, ended[row])
            if map is not None and len(map) and len(drive):
                stamp = int(drive.stamps[-1])
                log.write("/map", "visualization_msgs/msg/MarkerArray", stamp, map_markers(map, stamp))
        write_whole(ctx.folder / LAYOUT, files(__package__).joinpath(LAYOUT).read_text(encoding="utf-8"))


def _write_paths(log: LogStream, drive: Drive) -> None:
    """The paths of one log, at its end."""
    last, has_estimate = int(drive.stamps[-1]), known(drive.estimate)
    if has_estimate.any():
        path = _path(drive.stamps[has_estimate], drive.estimate[has_estimate], last)
        log.append("/estimate/path", "nav_msgs/msg/Path", last, path)
    alone = drive.odometry_alone()
    if alone is not None:
        log.append("/odometry/path", "nav_msgs/msg/Path", last, _path(drive.stamps, alone, last))


def _path(stamps: Ints, poses: Array, now: int) -> bytes:
    every = -(-len(poses) // PATH_POSES)
    return path_bytes(stamps[::every], poses[::every], now)

"""Plots estimated trajectories over the map."""

from collections.abc import Sequence

import numpy as np

from omninav.pipeline import Context, Figure, Outputs, Stage
from omninav.pipeline.report.plot_style import plot
from omninav.stages.values.drive import Array, Drive, known
from omninav.stages.values.grid import OccupancyGrid
from omninav.stages.values.map_places import AnyMap, map_poses
from omninav.stages.values.topological_map import TopologicalMap

from .drawing import (
    ESTIMATE,
    MARK,
    ODOMETRY,
    TRUTH,
    draw_grid,
    draw_map,
    extent_of,
    fitting_height,
    plan_axes,
)


class TrajectoryOverMap(Stage):
    """Plots estimate, truth and odometry alone over the map's references and edges, a panel per log (map frame, m).

    With `grid` wired, all of it over what is occupied there.
    """

    class Out(Outputs):
        """`figure`: the last log; `earlier`: where there are several, the ones before it in one plot."""

        figure: Figure | None = None
        earlier: Figure | None = None

    def step(
        self,
        ctx: Context,
        drive: Drive,
        map: AnyMap | None = None,
        grid: OccupancyGrid | None = None,
    ) -> Out:
        """The whole run at once."""
        logs = drive.by_log
        if not logs:
            return self.Out()
        last = Figure(
            name="trajectory_over_map",
            title="Trajectory over the map",
            caption=_caption(logs[-1], map),
            content=_draw(logs[-1:], map, grid),
            order=10,
        )
        if len(logs) == 1:
            return self.Out(figure=last)
        earlier = Figure(
            name="trajectory_over_map_earlier",
            title="Trajectories of the earlier logs",
            caption=f"The {len(logs) - 1} log(s) before the last one, in their order.",
            content=_draw(logs[:-1], map, grid),
            order=11,
        )
        return self.Out(figure=last, earlier=earlier)


def _caption(drive: Drive, map: AnyMap | None) -> str:
    words = [f"The estimate of {len(drive)} frames"]
    words.append("over the true path." if drive.has_truth else "; this log has no ground truth.")
    if drive.odometry_alone() is not None:
        anchor = "starts at the first true pose" if drive.has_truth else "is laid through the last estimate"
        words.append(f"Odometry alone {anchor}.")
    if isinstance(map, TopologicalMap) and len(map):
        words.append(
            f"Grey: {len(map)} places at their medoids, joined along the images between them, all poses taken from "
            f"{map.pose_source}: the estimate is the most probable place's, turned as the view is."
        )
    elif map is not None and len(map):
        words.append(f"Grey: {len(map)} reference views, their poses taken from {map.pose_source}.")
    return " ".join(words).replace(" ;", ";")


def _draw(logs: Sequence[Drive], map: AnyMap | None, grid: OccupancyGrid | None) -> bytes:
    columns = min(len(logs), 2)
    rows = -(-len(logs) // columns)
    extent = _shown(logs, map)
    width = 8.0 / columns
    with plot(8.0, rows * fitting_height(extent, width, 2.6, 8.5 if columns == 1 else 5.0)) as drawn:
        for number, drive in enumerate(logs):
            axes = drawn.canvas.add_subplot(rows, columns, number + 1)
            draw_grid(axes, grid)
            draw_map(axes, map)
            odometry = drive.odometry_alone()
            if odometry is not None:
                axes.plot(
                    odometry[:, 0],
                    odometry[:, 1],
                    color=ODOMETRY,
                    linewidth=1.2,
                    linestyle="--",
                    label="odometry alone",
                )
            if drive.has_truth:
                axes.plot(
                    drive.truth[:, 0], drive.truth[:, 1], color=TRUTH, linewidth=2.4, alpha=0.55, label="ground truth"
                )
            axes.plot(*_broken_at_jumps(drive), color=ESTIMATE, linewidth=1.3, label="estimate", zorder=4)
            axes.plot(drive.estimate[:, 0], drive.estimate[:, 1], ".", color=ESTIMATE, markersize=2.2, zorder=4)
            start = (
                drive.truth[known(drive.truth)][:1] if drive.has_truth else drive.estimate[known(drive.estimate)][:1]
            )
            axes.plot(start[:, 0], start[:, 1], "s", color=MARK, markersize=7, zorder=7, label="start")
            plan_axes(axes, extent)
            if len(logs) > 1:
                axes.set_title(f"log {drive.log[0]}")
        handles, labels = drawn.canvas.axes[0].get_legend_handles_labels()
        drawn.canvas.legend(handles, labels, loc="outside lower center", ncols=5)
    return drawn.content


def _shown(logs: Sequence[Drive], map: AnyMap | None) -> tuple[float, float, float, float] | None:
    """The extent of truth and map, or of estimate and map: odometry and a lost filter may leave the plot."""
    kept = [drive.truth if drive.has_truth else drive.estimate for drive in logs]
    return extent_of(*kept, map_poses(map), margin=0.08)


def _broken_at_jumps(drive: Drive) -> tuple[Array, Array]:
    """The estimate's line, interrupted where it jumps by more than 2.5 m: a jump is not a path that was driven."""
    x, y = drive.estimate[:, 0].copy(), drive.estimate[:, 1].copy()
    jumps = np.flatnonzero(np.hypot(np.diff(x), np.diff(y)) > 2.5) + 1
    return np.insert(x, jumps, np.nan), np.insert(y, jumps, np.nan)

"""Plots tracked features and homing vectors at a few frames of a drive."""

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated, NamedTuple

import numpy as np

from omninav.pipeline import Bounds, Context, Figure, Outputs, Stage
from omninav.pipeline.report.plot_style import plot
from omninav.stages.values.drive import Array, Drive
from omninav.stages.values.floor_plan import FloorPlan
from omninav.stages.values.homing import HomingVector, PathProgress
from omninav.stages.values.image import Pixels
from omninav.stages.values.planned_route import PlannedRoute
from omninav.stages.values.thumbnails import Thumbnails, decoded
from omninav.stages.values.topological_map import TopologicalMap

from .draw_homing import BRIGHT, LOST, NAMES, VECTOR, draw_robot_view, draw_target_view, hexadecimal, is_known
from .drawing import (
    ESTIMATE,
    MARK,
    ODOMETRY,
    TRUTH,
    broken_at_jumps,
    draw_plan,
    draw_pose,
    plan_axes,
)
from .homing_snapshot import EncodedHomingView
from .snapshot_times import spread_out
from .target_images import target_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes

AROUND_M = 2.2
"""Metres around the robot that the plan shows."""


class Row(NamedTuple):
    """A row of the plot: when, what was seen, the target's image, where the robot and the target truly were."""

    frame: int
    seconds: float
    snapshot: EncodedHomingView
    vector: HomingVector
    target: Pixels | None
    pose: Array
    goal: Array
    path: Array


class HomingSnapshots(Stage):
    """Plots the robot's image beside the target's at a few frames, with tracked features and the homing vector.

    The last panel of each row is the floor around the robot (m): its path so far, the vector, and where the target view
    was truly taken. `thumbnails` holds the images of the map's views, without `map` those of the path's own; without
    them the target's features stand alone. Without `map` the target is where the run began.
    """

    frames: Annotated[int, Bounds(ge=1, le=8)] = 4
    """Number of rows."""

    class Out(Outputs):
        """`figure`: absent where there never was a target."""

        figure: Figure | None = None

    def step(
        self,
        ctx: Context,
        drive: Drive,
        snapshots: Sequence[EncodedHomingView | None],
        progress: Sequence[PathProgress | None],
        routes: Sequence[PlannedRoute | None] | None = None,
        map: TopologicalMap | None = None,
        thumbnails: Thumbnails | None = None,
        plan: FloorPlan | None = None,
    ) -> Out:
        """The whole run at once."""
        path = drive.truth
        seen = [(row, g) for row, g in enumerate(snapshots) if g is not None and g.vector is not None]
        if not seen:
            return self.Out()
        found = []
        for row, snapshot in (seen[n] for n in chosen_rows([g for _, g in seen], self.frames)):
            assert snapshot.vector is not None
            goal, target = target_of(progress[row], None if routes is None else routes[row], map, path[0], thumbnails)
            found.append(
                Row(
                    int(drive.frames[row]),
                    drive.seconds[row],
                    snapshot,
                    snapshot.vector,
                    target,
                    path[row],
                    goal,
                    path[: row + 1],
                )
            )
        return self.Out(
            figure=Figure(
                name="homing_snapshots",
                title="Tracked features and homing vectors",
                caption="Left: the robot's image at a few frames, the features of the local map in it, and "
                "the homing vector drawn over the floor. Middle: the target view, the same features in the "
                "same colours; light: those that are not tracked. Right: the floor around the robot, its true path "
                "so far, the homing vector (as long as odometry says, else dashed), and where the target "
                "view was truly taken (green).",
                content=_draw(found, plan),
                media_type="image/jpeg",
                order=6,
            )
        )


def chosen_rows(snapshots: Sequence[EncodedHomingView], frames: int) -> list[int]:
    """Spread over the drive; the last of them gives way to the first at which the target was lost."""
    spread = spread_out(len(snapshots), frames)
    lost = [
        n for n, snapshot in enumerate(snapshots) if snapshot.vector is not None and snapshot.vector.state == "lost"
    ]
    if lost and lost[0] not in spread and len(spread) > 2:
        nearest = min(spread[1:-1], key=lambda n: abs(n - lost[0]))
        spread = sorted({*spread, lost[0]} - {nearest})
    return spread


def _draw(found: Sequence[Row], plan: FloorPlan | None) -> bytes:
    columns, rows = found[0].snapshot.size
    strip = columns > 2.5 * rows  # panoramas stand one above the other
    high = 10.5 / 3.15 * rows / columns
    with plot(10.5, len(found) * (max(high, 2.6) + 0.4) + 0.4, dpi=100, media_type="image/jpeg") as drawn:
        grid = drawn.canvas.add_gridspec(2 * len(found) if strip else len(found), 3)
        for number, row in enumerate(found):
            pixels = draw_robot_view(decoded(row.snapshot.jpeg), row.snapshot)
            target = draw_target_view(row.target, row.snapshot, row.snapshot.size)
            here, there = (
                (grid[2 * number, :2], grid[2 * number + 1, :2]) if strip else (grid[number, 0], grid[number, 1])
            )
            _show(drawn.canvas.add_subplot(here), pixels, f"frame {row.frame} · {row.seconds:.1f} s")
            _show(drawn.canvas.add_subplot(there), target, f"going to: {row.snapshot.target or 'a view'}")
            beside = grid[2 * number : 2 * number + 2, 2] if strip else grid[number, 2]
            axes = drawn.canvas.add_subplot(beside)
            _draw_floor(axes, row, plan)
            if number < len(found) - 1:
                axes.set_xlabel("")
        drawn.canvas.legend(handles=_legend(), loc="outside lower center", ncols=6)
    return drawn.content


def _show(axes: "Axes", pixels: Pixels, title: str) -> None:
    axes.imshow(pixels[:, :, ::-1], interpolation="antialiased")
    axes.set_title(title, fontsize=8.5)
    axes.set_axis_off()


def _draw_floor(axes: "Axes", row: Row, plan: FloorPlan | None) -> None:
    draw_plan(axes, plan)
    axes.plot(*broken_at_jumps(row.path).T, color=ESTIMATE, linewidth=1.4, zorder=2)
    axes.plot(*row.goal[:2, None], "o", color=MARK, markersize=10, fillstyle="none", markeredgewidth=2, zorder=5)
    draw_pose(axes, row.goal, 0.35, MARK)
    draw_pose(axes, row.pose, 0.35, TRUTH)
    vector = row.vector
    towards = row.pose[2] + vector.direction
    length = 1.0 if vector.metres is None else max(vector.metres, 0.05)
    tip = row.pose[:2] + length * np.array([math.cos(towards), math.sin(towards)])
    if np.isfinite(tip).all() and is_known(vector):
        colour = ODOMETRY if vector.state == "lost" else hexadecimal(VECTOR)
        line = "--" if vector.metres is None or vector.state == "lost" else "-"
        arrow = {"arrowstyle": "-|>", "color": colour, "linewidth": 2.2, "shrinkA": 0, "shrinkB": 0, "linestyle": line}
        axes.annotate("", xy=tip.tolist(), xytext=row.pose[:2].tolist(), arrowprops=arrow, zorder=7)
    x, y = np.nan_to_num(row.pose[:2])
    plan_axes(axes, (x - AROUND_M, x + AROUND_M, y - AROUND_M, y + AROUND_M))
    kinds = row.snapshot.kinds
    counted = f"{vector.inliers} agree, {int(np.count_nonzero(kinds == LOST))} of {len(kinds)} lost"
    far = f"{vector.metres:.2f} m" if vector.metres is not None else f"{100 * vector.ratio:.0f} % of the distance left"
    text = (
        "the target is lost"
        if vector.state == "lost"
        else f"{far}, turn {round(math.degrees(vector.turn))}°\n{counted}"
    )
    axes.set_title(text, fontsize=8.5)


def _legend() -> list[object]:
    from matplotlib.lines import Line2D

    looks = {
        kind: Line2D(
            [], [], linestyle="", marker="x" if kind == LOST else "o", color=hexadecimal(BRIGHT[kind]), label=name
        )
        for kind, name in NAMES.items()
    }
    vector = Line2D([], [], color=hexadecimal(VECTOR), linewidth=2.5, label="homing vector")
    spot = Line2D([], [], linestyle="", marker="o", fillstyle="none", markersize=9, color=MARK, label="target, truly")
    return [*looks.values(), vector, spot]

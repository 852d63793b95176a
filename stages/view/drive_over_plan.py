"""Where a robot drove, over the plan of its world."""

from collections.abc import Sequence

import numpy as np

from omninav.pipeline import Context, Outputs, Stage, Tick
from omninav.pipeline.results import Figure
from omninav.stages.values.drive_tally import DriveTally
from omninav.stages.values.drives import Array, drives
from omninav.stages.values.floor_plan import FloorPlan
from omninav.stages.values.pose import Motion, Pose

from .style import EDGE, ESTIMATE, MARK, ODOMETRY, REFERENCE, fitting_height, picture, plan_axes


class DriveOverPlan(Stage):
    """The true path of a closed loop over the floor plan, every contact on it, and what odometry made of it."""

    class Out(Outputs):
        """`figure`: one picture; absent where the robot never was."""

        figure: Figure | None = None

    def step(
        self,
        ctx: Context,
        ticks: Sequence[Tick],
        truth: Sequence[Pose | None],
        motion: Sequence[Motion | None],
        tallies: Sequence[DriveTally | None],
        plan: FloorPlan,
    ) -> Out:
        """The whole run at once."""
        logs = drives(ticks, [None] * len(ticks), truth, motion)
        if not logs or not logs[-1].has_truth:
            return self.Out()
        counts = np.array([0 if tally is None else tally.collisions for tally in tallies])
        contacts = np.flatnonzero(np.diff(counts, prepend=0) > 0)
        path, dead_reckoning = logs[-1].truth, logs[-1].odometry_alone()
        return self.Out(
            figure=Figure(
                name="drive_over_plan",
                title="Where it drove",
                caption=f"The true path of {len(path)} ticks over the floor plan, which the robot does not know. "
                f"It came into contact with something {int(counts.max())} times (orange crosses). "
                "Dashed: where its wheels say it went.",
                content=_draw(path, dead_reckoning, path[contacts], plan),
                order=4,
            )
        )


def _draw(path: Array, dead_reckoning: Array | None, contacts: Array, plan: FloorPlan) -> bytes:
    from matplotlib.collections import PolyCollection

    extent = (-0.3, plan.width + 0.3, -0.3, plan.depth + 0.3)
    with picture(8.0, fitting_height(extent, 8.0, 2.6, 8.5)) as drawn:
        axes = drawn.canvas.add_subplot()
        axes.add_collection(PolyCollection(list(plan.outlines), facecolors=EDGE, edgecolors=REFERENCE, linewidths=0.6))
        if dead_reckoning is not None:
            axes.plot(*dead_reckoning[:, :2].T, "--", color=ODOMETRY, linewidth=1.0, label="odometry alone")
        axes.plot(*path[:, :2].T, color=ESTIMATE, linewidth=1.6, label="true path")
        axes.plot(*path[:1, :2].T, "s", color=MARK, markersize=7, label="start")
        if len(contacts):
            axes.plot(*contacts[:, :2].T, "x", color=ODOMETRY, markersize=7, markeredgewidth=2, label="contact")
        plan_axes(axes, extent)
        drawn.canvas.legend(loc="outside lower center", ncols=4)
    return drawn.content

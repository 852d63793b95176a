"""How far off the estimate was, frame by frame."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from omninav.pipeline import Context, Outputs, Stage, Tick
from omninav.pipeline.results import Figure
from omninav.stages.geometry.errors import first_settled, heading_errors_deg, position_errors
from omninav.stages.values.belief import PoseEstimate
from omninav.stages.values.drives import Array, Drive, drives
from omninav.stages.values.pose import Motion, Pose

from .style import ESTIMATE, MARK, ODOMETRY, picture

if TYPE_CHECKING:
    from matplotlib.ticker import Formatter


class ErrorOverTime(Stage):
    """Position (m) and heading error (degrees) over time, odometry alone beside them, convergence marked.

    Nothing is drawn for logs without ground truth.
    """

    class Out(Outputs):
        """`figure`: one pair of curves per log."""

        figure: Figure | None = None

    def step(
        self,
        ctx: Context,
        ticks: Sequence[Tick],
        estimates: Sequence[PoseEstimate | None],
        truth: Sequence[Pose | None],
        motion: Sequence[Motion | None],
    ) -> Out:
        """The whole run at once."""
        logs = [drive for drive in drives(ticks, estimates, truth, motion) if drive.has_truth]
        if not logs:
            return self.Out()
        return self.Out(
            figure=Figure(
                name="error_over_time",
                title="Error over time",
                caption="Distance from the true position and size of the heading error. The line marks where "
                "the error stays below 1 m and 20 degrees for ten frames. The scale is logarithmic.",
                content=_draw(logs),
                order=20,
            )
        )


def _draw(logs: Sequence[Drive]) -> bytes:
    with picture(8.0, 4.2 * len(logs)) as drawn:
        for number, drive in enumerate(logs):
            position, heading = (
                position_errors(drive.estimate, drive.truth),
                heading_errors_deg(drive.estimate, drive.truth),
            )
            odometry = drive.odometry_alone()
            scored = np.flatnonzero(np.isfinite(position))
            settled = first_settled(position[scored], heading[scored])
            upper = drawn.canvas.add_subplot(2 * len(logs), 1, 2 * number + 1)
            lower = drawn.canvas.add_subplot(2 * len(logs), 1, 2 * number + 2, sharex=upper)
            for axes, errors, name, limit in (
                (upper, position_errors, "position error (m)", 1.0),
                (lower, heading_errors_deg, "heading error (°)", 20.0),
            ):
                if odometry is not None:
                    axes.plot(
                        drive.seconds,
                        errors(odometry, drive.truth),
                        color=ODOMETRY,
                        linestyle="--",
                        linewidth=1.2,
                        label="odometry alone",
                    )
                axes.plot(
                    drive.seconds, errors(drive.estimate, drive.truth), color=ESTIMATE, linewidth=1.2, label="estimate"
                )
                axes.axhline(limit, color="#999999", linewidth=0.7, linestyle=":")
                if settled is not None:
                    axes.axvline(
                        drive.seconds[scored[settled]],
                        color=MARK,
                        linewidth=1.2,
                        label=f"converged after {scored[settled]} frames",
                    )
                axes.set_ylabel(name)
                axes.set_yscale("log")
            upper.set_ylim(bottom=_floor(position[scored]))
            lower.set_ylim(bottom=_floor(heading[scored]), top=250)
            upper.tick_params(labelbottom=False)
            lower.set_xlabel("time since the log's first frame (s)")
            upper.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=3)
            for axes in (upper, lower):
                axes.yaxis.set_major_formatter(_plain())
            if len(logs) > 1:
                upper.set_title(f"log {drive.log}")
    return drawn.content


def _floor(errors: Array) -> float:
    """Where a logarithmic axis begins: below nearly all errors, without following single zeros down."""
    return max(float(np.percentile(errors, 2)) / 2, 1e-4) if len(errors) else 1e-2


def _plain() -> "Formatter":
    from matplotlib.ticker import FuncFormatter

    return FuncFormatter(lambda value, _: f"{value:g}")

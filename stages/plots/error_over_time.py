"""Plots the error of the estimate, frame by frame."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from omninav.pipeline import Context, Figure, Outputs, Stage
from omninav.pipeline.report.plot_style import plot
from omninav.stages.geometry.plane.pose_errors import first_settled, heading_errors_deg, position_errors
from omninav.stages.values.drive import Array, Drive

from .drawing import ESTIMATE, MARK, ODOMETRY

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.ticker import Formatter


class ErrorOverTime(Stage):
    """Plots position (m) and heading error (degrees) over time, odometry alone beside them, convergence marked.

    Nothing is drawn for logs without ground truth.
    """

    class Out(Outputs):
        """`figure`: one pair of panels per log, on the same scales."""

        figure: Figure | None = None

    def step(
        self,
        ctx: Context,
        drive: Drive,
    ) -> Out:
        """The whole run at once."""
        logs = [log for log in drive.by_log if log.has_truth]
        if not logs:
            return self.Out()
        return self.Out(
            figure=Figure(
                name="error_over_time",
                title="Error over time",
                caption="Distance from the true position and size of the heading error. Odometry alone starts at each "
                "log's first true pose and is not aligned. The green line marks where the estimate stays below 1 m and "
                "20 degrees for ten frames. The scale is logarithmic.",
                content=_draw(logs),
                order=20,
            )
        )


def _draw(logs: Sequence[Drive]) -> bytes:
    """Logs stand side by side on the same scales, at most three in a row."""
    columns = min(len(logs), 3)
    bands = -(-len(logs) // columns)
    kinds = (("position error (m)", position_errors, 1.0, None), ("heading error (°)", heading_errors_deg, 20.0, 250))
    floors = [_floor(np.concatenate([errors(log.estimate, log.truth) for log in logs])) for _, errors, _, _ in kinds]
    with plot(8.0 if columns == 1 else 10.0, 4.2 * bands) as drawn:
        panels = drawn.canvas.subplots(2 * bands, columns, sharey="row", squeeze=False)
        for panel in panels[:, len(logs) - columns * (bands - 1) :][2 * (bands - 1) :].flat:
            panel.remove()
        for number, drive in enumerate(logs):
            band, column = divmod(number, columns)
            odometry, settled = drive.odometry_alone(), _settled(drive)
            upper, lower = panels[2 * band : 2 * band + 2, column]
            for axes, (name, errors, limit, top), floor in zip((upper, lower), kinds, floors, strict=True):
                if odometry is not None:
                    wrong = errors(odometry, drive.truth)
                    axes.plot(drive.seconds, wrong, "--", color=ODOMETRY, linewidth=1.2, label="odometry alone")
                wrong = errors(drive.estimate, drive.truth)
                axes.plot(drive.seconds, wrong, color=ESTIMATE, linewidth=1.2, label="estimate")
                axes.axhline(limit, color="#999999", linewidth=0.7, linestyle=":")
                if settled is not None:
                    axes.axvline(drive.seconds[settled], color=MARK, linewidth=1.2, label="converged")
                axes.set_yscale("log")
                axes.set_ylim(bottom=floor, top=top)
                axes.yaxis.set_major_formatter(_plain())
                axes.yaxis.set_minor_formatter("")
                if not column:
                    axes.set_ylabel(name)
            upper.tick_params(labelbottom=False)
            lower.set_xlim(upper.get_xlim())
            lower.set_xlabel("time since the log's first frame (s)")
            converged = "never converged" if settled is None else f"converged after {settled} frames"
            ends = f"at the end {_last(drive.estimate, drive):.2f} m off"
            beside = "" if odometry is None else f", odometry {_last(odometry, drive):.2f} m"
            upper.set_title(f"log {drive.log[0]}: {converged}\n{ends}{beside}", fontsize=8.5)
        named = {label: handle for axes in drawn.canvas.axes for handle, label in zip(*_legend(axes), strict=True)}
        drawn.canvas.legend(named.values(), named.keys(), loc="outside lower center", ncols=3)
    return drawn.content


def _settled(drive: Drive) -> int | None:
    position, heading = position_errors(drive.estimate, drive.truth), heading_errors_deg(drive.estimate, drive.truth)
    scored = np.flatnonzero(np.isfinite(position))
    settled = first_settled(position[scored], heading[scored])
    return None if settled is None else int(scored[settled])


def _last(poses: Array, drive: Drive) -> float:
    errors = position_errors(poses, drive.truth)
    there = errors[np.isfinite(errors)]
    return float(there[-1]) if len(there) else float("nan")


def _legend(axes: "Axes") -> tuple[list[Any], list[Any]]:
    return axes.get_legend_handles_labels()


def _floor(errors: Array) -> float:
    """Where a logarithmic axis begins: below nearly all errors, without following single zeros down."""
    errors = errors[np.isfinite(errors)]
    return max(float(np.percentile(errors, 2)) / 2, 1e-4) if len(errors) else 1e-2


def _plain() -> "Formatter":
    from matplotlib.ticker import FuncFormatter

    return FuncFormatter(lambda value, _: f"{value:g}")

"""Plots the error of the estimate, frame by frame."""

from collections.abc import Sequence

import numpy as np

from omninav.pipeline import Context, PlotStage, counted
from omninav.pipeline.report.chart import Chart, stacked
from omninav.stages.geometry.arrays import Array
from omninav.stages.geometry.plane.pose_errors import first_settled, heading_errors_deg, position_errors
from omninav.stages.values.drive import Drive


class ErrorOverTime(PlotStage):
    """Plots position (m) and heading error (degrees) over time, odometry alone beside them, convergence marked.

    Nothing is drawn for logs without ground truth.
    """

    def step(self, ctx: Context, drive: Drive) -> PlotStage.Out:
        logs = [log for log in drive.by_log if log.has_truth]
        if not logs:
            return self.Out()
        return self.drawn(
            name="error_over_time",
            title="Error over time",
            caption=" ".join(_summary(log, len(logs) > 1) for log in logs)
            + " Odometry alone starts at the first true pose and is not aligned. Dotted: the limits of convergence, "
            "1 m and 20°. The scale is logarithmic.",
            content=_draw(logs),
            order=11,
        )


def _summary(drive: Drive, several: bool) -> str:
    settled, odometry = _settled(drive), drive.odometry_alone()
    which = f"Log {drive.log[0]}: " if several else ""
    words = "converged at once" if settled == 0 else "never converged"
    if settled:
        words = f"converged after {counted(settled, 'frame')} (green line)"
    beside = "" if odometry is None else f", odometry alone {_last(odometry, drive):.3f} m"
    text = f"{which}{words}; at the end the estimate is {_last(drive.estimate, drive):.3f} m off{beside}."
    return text[:1].upper() + text[1:]


def _draw(logs: Sequence[Drive]) -> bytes:
    """Logs follow one another on one axis of time."""
    begins = np.cumsum([0.0, *(float(drive.seconds[-1]) + 1.0 for drive in logs)])
    charts = []
    for name, errors, limit, top in (
        ("position error (m)", position_errors, 1.0, np.inf),
        ("heading error (°)", heading_errors_deg, 20.0, 180.0),
    ):
        lines = [
            (drive, begin, errors(drive.estimate, drive.truth), None if alone is None else errors(alone, drive.truth))
            for drive, begin in zip(logs, begins.tolist(), strict=False)
            for alone in (drive.odometry_alone(),)
        ]
        every = np.concatenate([wrong for _, _, *both in lines for wrong in both if wrong is not None])
        every = every[np.isfinite(every)]
        low, high = _floor(every), min(max(float(every.max(initial=0.0)), limit) * 1.2, top)
        time = "time (s), logs one after the other" if len(logs) > 1 else "time (s)"
        chart = Chart((0.0, max(float(begins[-1]) - 1.0, 0.1)), (low, high), time, name, log=True)
        chart.base.level(limit, "quiet")
        for drive, begin, estimate, alone in lines:
            seconds = drive.seconds + begin
            if alone is not None:
                chart.base.line(np.column_stack([seconds, np.clip(alone, low, None)]), "orange", 1.6, dashed=True)
                chart.name("odometry alone", "orange", "dashes")
            chart.base.line(np.column_stack([seconds, np.clip(estimate, low, None)]), "blue", 1.6)
            chart.name("estimate", "blue")
            settled = _settled(drive)
            if settled:  # at 0 the axis would hide it
                chart.base.upright(float(seconds[settled]), "green")
                chart.name("converged", "green")
            if len(logs) > 1:
                chart.base.upright(begin, "line", f"log {drive.log[0]}")
        charts.append(chart)
    charts[0].unnamed()
    return stacked(charts)


def _settled(drive: Drive) -> int | None:
    position, heading = position_errors(drive.estimate, drive.truth), heading_errors_deg(drive.estimate, drive.truth)
    scored = np.flatnonzero(np.isfinite(position))
    settled = first_settled(position[scored], heading[scored])
    return None if settled is None else int(scored[settled])


def _last(poses: Array, drive: Drive) -> float:
    errors = position_errors(poses, drive.truth)
    there = errors[np.isfinite(errors)]
    return float(there[-1]) if len(there) else float("nan")


def _floor(errors: Array) -> float:
    """Start of a logarithmic axis: below nearly all errors, without following single zeros down."""
    return max(float(np.percentile(errors, 2)) / 2, 1e-4) if len(errors) else 1e-2

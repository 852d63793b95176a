"""Plots the confidence, frame by frame."""

import numpy as np

from omninav.pipeline import Context, Figure, FigureStage
from omninav.pipeline.report.chart import Chart
from omninav.stages.values.drive import Drive


class ConfidenceOverTime(FigureStage):
    """Plots the probability that the estimate is right over time (s), the last log's. Nothing without a monitor."""

    def step(self, ctx: Context, drive: Drive) -> FigureStage.Out:
        """The whole run at once."""
        last = drive.last_log
        if not np.isfinite(last.confidence).any():
            return self.Out()
        seconds = last.seconds
        chart = Chart((0.0, max(float(seconds[-1]), 0.1)), (0.0, 1.0), "time (s)", "confidence", height=(140.0, 140.0))
        chart.base.level(0.5, "quiet")
        chart.base.line(np.column_stack([seconds, last.confidence]), "blue", 1.6)
        low = float((last.confidence < 0.5).mean())
        figure = Figure(
            name="confidence_over_time",
            title="Confidence over time",
            caption="The probability that the estimate is right, from the images and the belief; no ground truth is "
            f"used. {100 * low:.0f} % of the frames are below a half (dotted).",
            content=chart.svg(),
            media_type="image/svg+xml",
            order=12,
        )
        return self.Out(figure=figure)

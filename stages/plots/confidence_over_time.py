"""Plots the confidence, frame by frame."""

import numpy as np

from omninav.pipeline import Context, PlotStage
from omninav.pipeline.report.chart import Chart, Colour
from omninav.stages.values.drive import Drive
from omninav.stages.values.stretches import Stretches, StretchState

BANDS: dict[StretchState, Colour] = {
    "searching": "blue",
    "unsure": "orange",
    "blind": "grey",
    "wrong": "pink",
    "jumped": "green",
}
"""Colours of stretches."""
MAX_TOLD = 3
"""Longest stretches that the caption explains."""


class ConfidenceOverTime(PlotStage):
    """Plots the probability that the estimate is right over time (s), the last log's. Nothing without a monitor.

    Bands are the stretches that were not tracked, of which the caption explains the longest.
    """

    def step(self, ctx: Context, drive: Drive, stretches: Stretches | None = None) -> PlotStage.Out:
        last = drive.last_log
        if not np.isfinite(last.confidence).any():
            return self.Out()
        seconds = last.seconds
        chart = Chart((0.0, max(float(seconds[-1]), 0.1)), (0.0, 1.05), "time (s)", "confidence", height=(140.0, 140.0))
        found = [each for each in (stretches.all if stretches else ()) if each.log == last.log[0]]
        for each in found:
            chart.base.band((each.start_s, each.end_s), BANDS[each.state])
            chart.name(each.state, BANDS[each.state], "square")
        chart.base.level(0.5, "quiet")
        chart.base.line(np.column_stack([seconds, last.confidence]), "ink", 1.6)
        if found:
            chart.name("confidence", "ink")
        low = float((last.confidence < 0.5).mean())
        why = ": the place is doubtful, or the belief is wider than the tolerance" if low else ""
        longest = sorted(sorted(found, key=lambda each: each.first - each.last)[:MAX_TOLD], key=lambda each: each.first)
        told = [f" {each.images.capitalize()}, {each.cause}: {each.evidence}." for each in longest]
        return self.drawn(
            name="confidence_over_time",
            title="Confidence over time",
            caption="The probability that the estimate is right, computed from images and belief without ground truth. "
            f"{100 * low:.0f} % of the frames are below a half (dotted){why}.{''.join(told)}",
            content=chart.svg(),
            order=12,
        )

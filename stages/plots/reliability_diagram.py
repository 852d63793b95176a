"""Plots whether stated probabilities come true."""

import numpy as np

from omninav.pipeline import Context, PlotStage
from omninav.pipeline.report.chart import Chart
from omninav.stages.values.confidence import ConfidenceReliability


class ReliabilityDiagram(PlotStage):
    """Plots the share of right estimates over the confidence stated for them.

    Gives nothing where there is no confidence, or no ground truth.
    """

    def step(self, ctx: Context, reliability: ConfidenceReliability | None = None) -> PlotStage.Out:
        if reliability is None:
            return self.Out()
        chart = Chart((0.0, 1.0), (0.0, 1.0), "confidence", "share of frames within the tolerance",
                      height=(260.0, 260.0))  # fmt: skip
        chart.base.line(np.array([(0.0, 0.0), (1.0, 1.0)]), "quiet", dashed=True)
        points = np.column_stack([reliability.stated, reliability.observed])
        chart.base.line(points, "blue")
        chart.base.discs(points, 3.0 + 9.0 * np.sqrt(reliability.counts / reliability.counts.sum()), "blue", 0.7)
        chart.name("as observed, larger for more frames", "blue", "dot")
        chart.name("as it should be", "quiet", "dashes")
        return self.drawn(
            name="reliability",
            title="Reliability diagram of the confidence",
            caption="Share of the estimates that were within "
            f"{reliability.within_m:g} m and {reliability.within_deg:g}°, over the probability that was stated for it. "
            "Below the dashed line the confidence was too high.",
            content=chart.svg(),
            order=12,
        )

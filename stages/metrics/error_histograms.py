"""Distribution of position errors, log by log."""

from typing import Annotated

import numpy as np

from omninav.pipeline import Bounds, Context, Metrics, MetricStage
from omninav.stages.geometry.arrays import Array
from omninav.stages.geometry.plane.pose_errors import position_errors
from omninav.stages.values.drive import Drive, known

SMALL_M = 0.4
"""Largest error that is small, metres."""
LARGE_M = 2.0
"""Error above which it is large, metres."""
BIN_M = 0.2
"""Width of a bin, metres."""
BINS = 16
"""Number of bins."""


class ErrorHistograms(MetricStage):
    """Counts how often position errors of each size occur, in every log that has ground truth.

    Gross, Koenig & Müller 2005, Figures 5 and 6. `error_histograms`: a list with an entry for each log: lists over the
    sizes, `error_m`, the middle of each bin, and `share`, that of the frames; `small` and `large`, the shares of frames
    with errors of at most `small_m` and of more than `large_m`. The last bin holds everything larger.
    """

    skip: Annotated[float, Bounds(ge=0, lt=1)] = 0.0
    """Share of each log's frames, from its start, that does not count."""

    def step(self, ctx: Context, drive: Drive) -> MetricStage.Out:
        logs = [log.at(slice(int(self.skip * len(log)), None)) for log in drive.by_log]
        scored = [log.at(known(log.truth) & known(log.estimate)) for log in logs]
        errors = [position_errors(log.estimate, log.truth) for log in scored if len(log)]
        return self.Out(metrics=Metrics({"error_histograms": [self._histogram(each) for each in errors]}))

    def _histogram(self, errors: Array) -> dict[str, list[float] | float]:
        bins = np.minimum((errors / BIN_M).astype(np.int64), BINS - 1)
        return {
            "error_m": ((np.arange(BINS) + 0.5) * BIN_M).tolist(),
            "share": (np.bincount(bins, minlength=BINS) / len(errors)).tolist(),
            "small": float((errors <= SMALL_M).mean()),
            "large": float((errors > LARGE_M).mean()),
        }

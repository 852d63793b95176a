"""Distance of the belief's mean from the middle of the free space at first."""

import numpy as np

from omninav.pipeline import Context, Metrics, MetricSpec, MetricStage
from omninav.stages.values.drive import Drive, known
from omninav.stages.values.grid import FreeSpace

SPECS = {
    "initial_mean.from_middle_m": MetricSpec(title="Mean of the first belief, distance from the middle of the floor")
}


class InitialMean(MetricStage):
    """Measures the distance (m) between the mean of the first image's belief and the middle of the free space.

    Wolf, Burgard & Burkhardt 2005, section VI-B: with the mean of the samples as the estimate "in the beginning, the
    estimated position is always close to the center of the map". The middle is the mean of all free cells. Gives
    nothing without a belief.
    """

    def step(self, ctx: Context, drive: Drive, free: FreeSpace) -> MetricStage.Out:
        means = drive.last_log.mean
        means = means[known(means)]
        if not len(means):
            return self.Out()
        away = float(np.hypot(*(means[0, :2] - free.centres.mean(axis=0))))
        return self.Out(metrics=Metrics({"initial_mean": {"from_middle_m": away}}, SPECS))

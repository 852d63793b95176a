"""Success rate after the first correct estimate."""

import numpy as np

from omninav.pipeline import Context, Metrics, MetricSpec, MetricStage
from omninav.stages.values.drive import Drive, known

from .success_rate import is_good

SPECS = {
    "tracking_success.after_frames": MetricSpec(
        title="Images until right for the first time", unit="", better="lower", absent="never"
    ),
    "tracking_success.right_rate": MetricSpec(title="Right once it was right for the first time", better="higher"),
}


class TrackingSuccess(MetricStage):
    """Measures how reliably a robot is tracked once it has been found.

    Wolf, Burgard & Burkhardt 2005, section VI-D: success is below 100 % "because the system always had to perform a
    global localization in the beginning". Of the last log, under `tracking_success`: `after_frames`, how many
    frames went by before the estimate was right for the first time; `right_rate`, the share of frames from
    that one on in which it is. Gives nothing without ground truth.
    """

    def step(self, ctx: Context, drive: Drive) -> MetricStage.Out:
        last = drive.last_log
        scored = known(last.truth)
        if not scored.any():
            return self.Out()
        right = is_good(last.at(scored))
        first = int(np.argmax(right)) if right.any() else None
        found = {
            "after_frames": None if first is None else int(np.flatnonzero(scored)[first]),
            "right_rate": None if first is None else float(right[first:].mean()),
        }
        return self.Out(metrics=Metrics({"tracking_success": found}, SPECS))

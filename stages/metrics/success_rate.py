"""How often the estimate is good enough, and how soon after it was not."""

from typing import Annotated, Any

import numpy as np
import numpy.typing as npt

from omninav.pipeline import Bounds, Context, Outputs, Stage
from omninav.pipeline.graph.results import Metrics
from omninav.stages.geometry.plane.pose_errors import first_settled, heading_errors_deg, position_errors
from omninav.stages.geometry.plane.se2 import compose
from omninav.stages.values.drive import Drive, known


class SuccessRate(Stage):
    """The share of frames in which the estimate is within `within_m` and `within_deg` of the truth.

    Wolf, Burgard & Burkhardt 2005, section VI-D (2 m, 35 degrees): all frames count, finding the robot at first
    included, which is why 100 % is not reached (erratum 46a). Of the last log, under `success`: `within_rate`;
    `at_end`, 1 where the last frame is good, else 0; `one_mode_after_frames`, how many frames went by before the
    belief's heaviest mode, a metre and 30 degrees around it, held the share `one_mode` of the belief in a good frame
    (None: never; from a half on no other mode is as heavy). Where the robot was carried (its true pose left the way of
    its odometry by more than `carried_m` between two frames), `carried_at` says before which frame, and
    `recovered_after_frames` how many frames later the estimate is good for ten in a row (None: never).
    """

    within_m: Annotated[float, Bounds(gt=0)] = 2.0
    within_deg: Annotated[float, Bounds(gt=0, le=180)] = 35.0
    one_mode: Annotated[float, Bounds(gt=0, le=1)] = 0.5
    carried_m: Annotated[float, Bounds(gt=0)] = 1.0

    class Out(Outputs):
        """`metrics`: the entry `success` of metrics.json; absent without ground truth."""

        metrics: Metrics | None = None

    def step(
        self,
        ctx: Context,
        drive: Drive,
    ) -> Out:
        """The whole run at once."""
        last = drive.last_log
        return self.Out(metrics=Metrics({"success": self._of(last)}) if last.has_truth else None)

    def _of(self, drive: Drive) -> dict[str, Any]:
        scored = known(drive.truth)
        truth, estimate, frames = drive.truth[scored], drive.estimate[scored], np.flatnonzero(scored)
        position, heading = position_errors(estimate, truth), heading_errors_deg(estimate, truth)
        good = (position <= self.within_m) & (heading <= self.within_deg)  # a frame without estimate is not
        single = good & (drive.mode_weight[scored] >= self.one_mode)
        result: dict[str, Any] = {
            "within_rate": float(good.mean()),
            "at_end": float(good[-1]),
            "one_mode_after_frames": int(frames[np.argmax(single)]) if single.any() else None,
        }
        carried = carried_before(drive, self.carried_m)
        if len(carried):
            at = int(carried[-1])
            later = int(np.searchsorted(frames, at))
            again = first_settled(position[later:], heading[later:], self.within_m, self.within_deg)
            result |= {
                "carried_at": at,
                "recovered_after_frames": None if again is None else int(frames[later + again]) - at,
            }
        return result


def carried_before(drive: Drive, further_m: float) -> npt.NDArray[np.int64]:
    """Frames before which the robot was carried: where its truth lies off the way that odometry measured, by metres."""
    led = compose(drive.truth[:-1], np.nan_to_num(drive.motion[1:]))
    off = np.hypot(*(drive.truth[1:, :2] - led[:, :2]).T)
    return np.flatnonzero(off > further_m) + 1

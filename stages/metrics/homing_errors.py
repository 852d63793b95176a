"""Homing error: the distance to the target at the end of a drive."""

import math
from collections.abc import Sequence

import numpy as np

from omninav.pipeline import Context, Metrics, MetricSpec, MetricStage
from omninav.stages.geometry.plane.se2 import between, wrap
from omninav.stages.values.drive import Drive, known
from omninav.stages.values.homing import HomingVector, PathProgress

from .kidnap_recovery import kidnapped_rows

CARRIED_M = 0.5
"""Distance between true motion and odometry of one tick from which the robot was carried."""
SPECS = {
    "homing.end_error_m": MetricSpec(title="Distance to the target at the end", better="lower"),
    "homing.end_turn_deg": MetricSpec(title="Heading error at the end", better="lower"),
    "homing.reached": MetricSpec(title="Target reached", unit="%", better="higher", least=1.0),
    "homing.arrived": MetricSpec(title="Arrival reported", unit="%", better="higher"),
    "homing.time_s": MetricSpec(title="Time until arrival", better="lower", absent="never"),
    "homing.lost_rate": MetricSpec(title="Images in which the target was lost or doubtful", better="lower"),
    "homing.direction_error_deg": MetricSpec(title="Error of the homing direction", better="lower"),
    "homing.start_m": MetricSpec(title="Distance to the target at the start", context=True),
}
HEADLINES = tuple(
    f"homing.{name}"
    for name in ("reached", "end_error_m", "end_turn_deg", "time_s", "direction_error_deg.median", "lost_rate")
)
FROM_M = 0.3
"""Distance to the target beyond which the homing direction is measured, metres."""
WITHIN_M = 0.5
"""Largest distance from the target at which it is reached, metres."""


class HomingErrors(MetricStage):
    """Measures how close a robot comes to its first pose by homing, and the errors of its homing vectors.

    It begins where the robot was put down last, or where it drove to that is furthest away. Under `homing`: `start_m`,
    how far away that is; `arrived`, whether it said so (1 or 0); `reached`, whether it was within `WITHIN_M` of the
    target then; `end_error_m` and `end_turn_deg`, from the first pose to the last (and `end`, the same as experiments
    that pool runs read it); `time_s` until it arrived; `lost_rate`, the share of ticks in which the target was lost or
    doubtful; `direction_error_deg` (median, p90, max), between the homing vector and the true direction of the target;
    `inliers`, median; `first`: `direction_error_deg`, `turn_error_deg` and `inliers` of the first vector, doubtful or
    not, None where the target was lost. Gives nothing where there was never a vector, or no truth.
    """

    def step(
        self,
        ctx: Context,
        drive: Drive,
        vectors: Sequence[HomingVector | None],
        progress: Sequence[PathProgress | None],
    ) -> MetricStage.Out:
        poses = drive.truth
        if not len(poses) or not known(poses).all():
            return self.Out()
        targets = between(poses, poses[0])
        carried = kidnapped_rows(drive, CARRIED_M)
        away = int(carried[-1] if len(carried) else np.argmax(np.hypot(targets[:, 0], targets[:, 1])))
        after = {k: vector for k, vector in enumerate(vectors) if k >= away and vector is not None}
        if not after:
            return self.Out()
        found = {k: vector for k, vector in after.items() if vector.is_found}
        off = {k: _errors_deg(vector, targets[k]) for k, vector in found.items()}
        far = [off[k][0] for k in off if math.hypot(*targets[k, :2]) > FROM_M]
        arrived = next((k for k, at in enumerate(progress) if at is not None and at.arrived and k > away), None)
        first = min(after)
        at_first = None if after[first].state == "lost" else _errors_deg(after[first], targets[first])
        values = {
            "start_m": float(math.hypot(*targets[away, :2])),
            "reached": int(arrived is not None and math.hypot(*targets[arrived, :2]) <= WITHIN_M),
            "arrived": int(arrived is not None),
            "end_error_m": float(math.hypot(*targets[-1, :2])),
            "end": {"error_m": {"mean": float(math.hypot(*targets[-1, :2])), "std": 0.0}, "frames": 1},
            "end_turn_deg": abs(math.degrees(targets[-1, 2])),
            "time_s": None if arrived is None else float(drive.seconds[arrived] - drive.seconds[away]),
            "lost_rate": 1.0 - len(found) / len(after),
            "direction_error_deg": {
                "median": float(np.median(far)) if far else None,
                "p90": float(np.percentile(far, 90)) if far else None,
                "max": float(np.max(far)) if far else None,
            },
            "inliers": float(np.median([vector.inliers for vector in found.values()])) if found else None,
            "first": {
                "direction_error_deg": None if at_first is None else at_first[0],
                "turn_error_deg": None if at_first is None else at_first[1],
                "inliers": after[first].inliers,
            },
        }
        return self.Out(metrics=Metrics({"homing": values}, SPECS, HEADLINES, details=("homing.end",), foremost=True))


def _errors_deg(vector: HomingVector, target: np.ndarray) -> tuple[float, float]:
    direction = float(wrap(vector.direction - math.atan2(target[1], target[0])))
    return abs(math.degrees(direction)), abs(math.degrees(float(wrap(vector.turn - target[2]))))

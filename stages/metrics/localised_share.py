"""Shares of images within thresholds that the field reports, and how soon a lost robot finds itself again."""

from typing import Annotated, Any

import numpy as np

from omninav.pipeline import Bounds, Context, Metrics, MetricSpec, MetricStage
from omninav.stages.geometry.arrays import Array
from omninav.stages.geometry.plane.pose_errors import first_settled, heading_errors_deg, position_errors
from omninav.stages.geometry.plane.se2 import distances_along
from omninav.stages.values.drive import Drive, known

THRESHOLDS = {"fine": (0.25, 2.0), "medium": (0.5, 5.0), "coarse": (5.0, 10.0)}
"""Largest errors in position (m) and heading (degrees): Sattler et al. 2018."""
FOUND_M = 1.0
"""Position error (m) below which a lost robot has found itself, or `lost_m` where that is smaller."""

SPECS = {
    **{
        f"localised.{name}": MetricSpec(title=f"Frames within {metres:g} m and {degrees:g}°", unit="%", better="higher")
        for name, (metres, degrees) in THRESHOLDS.items()
    },
    "relocalisation.times_lost": MetricSpec(title="Times lost", better="lower"),
    "relocalisation.frames": MetricSpec(title="Images until found again, median", better="lower"),
    "relocalisation.metres": MetricSpec(title="Metres until found again, median", unit="m", better="lower"),
    "relocalisation.never": MetricSpec(title="Times not found again", better="lower"),
}


class LocalisedShare(MetricStage):
    """Measures the share of frames within the usual error thresholds, and how long a lost robot takes to recover.

    Of the last log. `localised`: the share of frames, one without an estimate among them, within 0.25 m and 2 degrees
    (`fine`), 0.5 m and 5 degrees (`medium`), 5 m and 10 degrees (`coarse`), as the benchmarks of visual localisation
    count (Sattler et al. 2018, "Benchmarking 6DOF outdoor visual localization in changing conditions", section 5).
    `relocalisation`: `times_lost`, how often the position error rose above `lost_m` or there was no estimate, a global
    start included; `frames` and `metres` of true path, the medians, until it stayed below 1 m (`lost_m` where that is
    less) and 20 degrees for ten frames; `never`: how often it did not until the end. Gives nothing without ground
    truth.
    """

    lost_m: Annotated[float, Bounds(gt=0)] = 2.5
    """Position error (m) above which the robot counts as lost."""

    def step(self, ctx: Context, drive: Drive) -> MetricStage.Out:
        last = drive.last_log
        last = last.at(known(last.truth))
        if not len(last):
            return self.Out()
        metres, degrees = position_errors(last.estimate, last.truth), heading_errors_deg(last.estimate, last.truth)
        metres[~known(last.estimate)] = np.inf
        shares = {name: float(((metres <= m) & (degrees <= d)).mean()) for name, (m, d) in THRESHOLDS.items()}
        found = relocalisations(metres, degrees, last.truth, self.lost_m)
        return self.Out(metrics=Metrics({"localised": shares, "relocalisation": found}, SPECS))


def relocalisations(position_m: Array, heading_deg: Array, truth: Array, lost_m: float) -> dict[str, Any]:
    """Times that a robot was lost and what it took to find itself, from its errors (N,) and true poses (N, 3)."""
    path = distances_along(truth)
    frames, metres, begins, never = [], [], 0, 0
    while (lost := np.flatnonzero(position_m[begins:] > lost_m)).size:
        begins += int(lost[0])
        settled = first_settled(position_m[begins:], heading_deg[begins:], min(FOUND_M, lost_m))
        if settled is None:
            never += 1
            break
        frames.append(settled)
        metres.append(path[begins + settled] - path[begins])
        begins += settled
    return {
        "times_lost": len(frames) + never,
        "frames": float(np.median(frames)) if frames else None,
        "metres": float(np.median(metres)) if metres else None,
        "never": never,
    }

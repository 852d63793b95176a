"""Angular error of homing vectors, by the distance to their target."""

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import Annotated, Any

import numpy as np

from omninav.pipeline import Bounds, Context, Metrics, MetricSpec, Outputs, Stage
from omninav.stages.geometry.arrays import Array
from omninav.stages.geometry.plane.se2 import between, wrap
from omninav.stages.values.drive import pose_rows
from omninav.stages.values.homing import HomingVector
from omninav.stages.values.homing_field import HomingField
from omninav.stages.values.pose import Pose

SPECS = {
    "homing_field.views": MetricSpec(title="Views", context=True),
    "homing_field.found_rate": MetricSpec(title="Views with a homing vector", better="higher"),
    "homing_field.median_deg": MetricSpec(title="Error of the direction, median", better="lower"),
    "homing_field.of_found_deg": MetricSpec(title="Error of the direction where found, median", better="lower"),
    "homing_field.turn_deg": MetricSpec(title="Error of the turn, median", better="lower"),
}
WIDTH_M = 1.0
"""Width of a ring, metres."""


class HomingFieldErrors(Stage):
    """Measures the angles between homing vectors and the true direction of the first pose, also by distance.

    Under `homing_field`: `views`; `found_rate`, of those from which there is a vector; `median_deg`, in which a view
    without one counts as 180 degrees, and `of_found_deg`, without these; `turn_deg`, the median error of the turn.
    `by_distance`: lists of the same for each ring around the target, out to `to_m`; `within`: over all views inside of
    each ring's outer edge. None where no view is.
    """

    rings: Annotated[int, Bounds(ge=1)] = 8
    """Number of rings around the target."""

    class Out(Outputs):
        """`field`: for the plot. Both absent without a view beside the target's."""

        metrics: Metrics | None = None
        field: HomingField | None = None

    def step(self, ctx: Context, truth: Sequence[Pose | None], vectors: Sequence[HomingVector | None]) -> Out:
        poses = pose_rows(truth)
        rows = [row for row in range(1, len(poses)) if np.isfinite(poses[[0, row]]).all()]
        if not rows:
            return self.Out()
        found, turns = field_of(poses[rows], poses[0], [vectors[row] for row in rows])
        edges = WIDTH_M * np.arange(self.rings + 1)
        metres = found.metres - 1e-9
        rings = [(metres >= low) & (metres < high) for low, high in pairwise(edges)]
        values: dict[str, Any] = summary(found.errors, turns)
        for name, parts in (("by_distance", rings), ("within", [metres < high for high in edges[1:]])):
            summaries = [summary(found.errors[part], turns[part]) for part in parts]
            values[name] = {
                "to_m": edges[1:].tolist(),
                **{key: [each[key] for each in summaries] for key in summaries[0]},
            }
        headlines = ("homing_field.median_deg", "homing_field.found_rate")
        return self.Out(metrics=Metrics({"homing_field": values}, SPECS, headlines), field=found)


def field_of(poses: Array, target: Array, vectors: Sequence[HomingVector | None]) -> tuple[HomingField, Array]:
    """The field over poses (N, 3) towards a target (3,), and the errors of the turns (N,), rad."""
    found = [vector if vector is not None and vector.is_found else None for vector in vectors]
    directions, turns = np.array(
        [(math.nan, math.nan) if vector is None else (vector.direction, vector.turn) for vector in found]
    ).T
    true = between(poses, target)
    field = HomingField(
        target,
        poses,
        wrap(directions + poses[:, 2]),
        np.abs(wrap(directions - np.arctan2(true[:, 1], true[:, 0]))),
        np.array([0 if vector is None else vector.inliers for vector in vectors], np.int64),
    )
    return field, np.abs(wrap(turns - true[:, 2]))


def summary(errors: Array, turns: Array) -> dict[str, float | int | None]:
    """Figures of some views: errors and turns (N,), rad, NaN where the target was not found; None without a view."""
    found = np.isfinite(errors)
    if not len(errors):
        return {"views": 0, "found_rate": None, "median_deg": None, "of_found_deg": None, "turn_deg": None}
    return {
        "views": len(errors),
        "found_rate": float(found.mean()),
        "median_deg": math.degrees(float(np.median(np.where(found, errors, math.pi)))),
        "of_found_deg": math.degrees(float(np.median(errors[found]))) if found.any() else None,
        "turn_deg": math.degrees(float(np.median(turns[found]))) if found.any() else None,
    }

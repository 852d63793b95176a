"""A run frame by frame, as a table."""

from typing import Any

import numpy as np
import numpy.typing as npt

from omninav.pipeline import Context, Stage
from omninav.pipeline.tables import write_table
from omninav.stages.geometry.arrays import Array
from omninav.stages.geometry.plane.pose_errors import heading_errors_deg, position_errors
from omninav.stages.values.confidence import TRACKING_STATES
from omninav.stages.values.drive import EVIDENCE, Drive, known

from .confidence import confident

Columns = dict[str, npt.NDArray[Any]]
PLANE = (("xx", 0, 0), ("xy", 0, 1), ("xh", 0, 2), ("yy", 1, 1), ("yh", 1, 2), ("hh", 2, 2))
"""Entries of a symmetric covariance over x, y and heading."""


class FramesTable(Stage):
    """Writes `frames.csv` and `frames.parquet`: a row for every frame, with estimate, truth, odometry and best match.

    Poses are in metres and radians in the map frame. Missing values are empty cells. `runs/README.md` states
    what the columns are.
    """

    def step(self, ctx: Context, drive: Drive) -> None:
        if ctx.folder is not None:
            logs = [columns_of(log) for log in drive.by_log] or [columns_of(drive)]
            whole: Any = np.ma.concatenate  # the plain one forgets masks
            table = {name: whole([log[name] for log in logs]) for name in logs[0]}
            for name in ("reference", "place", "confident"):
                table[name] = np.ma.masked_less(table[name], 0)
            write_table(ctx.folder / "frames", table)


def columns_of(drive: Drive) -> Columns:
    """The columns of one log; -1 where there is no reference, place or estimate."""
    columns: Columns = {"log": drive.log, "frame": drive.frames, "stamp_ns": drive.stamps, "time_s": drive.seconds}
    both = known(drive.estimate) & known(drive.truth)
    odometry = drive.odometry_alone() if len(drive) else None
    columns |= _poses("estimate", drive.estimate)
    stated = known(drive.estimate) & drive.covariance.any(axis=(1, 2))
    covariance = np.where(stated[:, None, None], drive.covariance, np.nan)
    columns |= {f"covariance_{name}": covariance[:, row, column] for name, row, column in PLANE}
    weighed = stated | (drive.place >= 0)  # a place has a probability, and no size
    columns["estimate_weight"] = np.where(weighed, drive.mode_weight, np.nan)
    columns["confident"] = np.where(weighed, confident(drive), -1)
    columns["confidence"] = drive.confidence
    columns["state"] = np.ma.masked_array(np.array((*TRACKING_STATES, ""))[drive.state], drive.state < 0)
    columns |= _poses("mean", drive.mean) | _poses("truth", drive.truth)
    columns["position_error_m"] = np.where(both, position_errors(drive.estimate, drive.truth), np.nan)
    columns["heading_error_deg"] = np.where(both, heading_errors_deg(drive.estimate, drive.truth), np.nan)
    columns |= _poses("motion", drive.motion, "turn")
    columns |= _poses("odometry", np.full_like(drive.motion, np.nan) if odometry is None else odometry)
    columns["reference"] = drive.reference
    columns |= {"similarity": drive.similarity, "visual_distance": drive.visual_distance}
    columns["reference_turn"] = drive.reference_turn
    columns["place"] = drive.place
    columns |= dict(zip(EVIDENCE, drive.evidence.T, strict=True))
    columns["conflict"] = np.ma.masked_array(np.array((*drive.conflicts, ""))[drive.conflict], drive.conflict < 0)
    return columns


def _poses(name: str, poses: Array, angle: str = "heading") -> Columns:
    return {f"{name}_{axis}": poses[:, column] for column, axis in enumerate(("x", "y", angle))}

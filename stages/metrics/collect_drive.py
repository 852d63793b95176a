"""Collects what every metric and plot of a drive needs."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from omninav.pipeline import Context, Outputs, Stage, Tick
from omninav.stages.values.belief import PoseEstimate
from omninav.stages.values.drive import Drive, pose_row
from omninav.stages.values.drive_tally import DriveTally
from omninav.stages.values.pose import Motion, Pose
from omninav.stages.values.similarity import BestMatch


class CollectDrive(Stage):
    """Collects ticks, estimates, ground truth, odometry and matches of a whole run into one value, a row per tick."""

    class Out(Outputs):
        """`drive`: for metrics and plots."""

        drive: Drive

    def step(
        self,
        ctx: Context,
        ticks: Sequence[Tick],
        truth: Sequence[Pose | None],
        motion: Sequence[Motion | None],
        estimates: Sequence[PoseEstimate | None] | None = None,
        tallies: Sequence[DriveTally | None] | None = None,
        matches: Sequence[BestMatch | None] | None = None,
    ) -> Out:
        """The whole run at once. Each sequence is read once, in order."""
        rows: list[tuple[Any, ...]] = []
        absent = [None] * len(ticks)
        for tick, estimate, true, moved, tally, match in zip(
            ticks,
            absent if estimates is None else estimates,
            truth,
            motion,
            absent if tallies is None else tallies,
            absent if matches is None else matches,
            strict=True,
        ):
            rows.append(
                (
                    (len(rows), tick.log, tick.frame, tick.stamp),
                    pose_row(estimate.pose if estimate else None),
                    np.full((3, 3), np.nan) if estimate is None else estimate.covariance,
                    0.0 if estimate is None else estimate.mode_weight,
                    pose_row(estimate.mean if estimate else None),
                    pose_row(true),
                    (np.nan,) * 3 if moved is None else (moved.x, moved.y, moved.turn),
                    (
                        0 if tally is None else tally.collisions,
                        -1 if estimate is None or estimate.place is None else estimate.place,
                        -1 if match is None else match.reference,
                    ),
                    np.nan if tally is None else tally.distance,
                    (np.nan,) * 3 if match is None else (match.similarity, match.distance, match.turn),
                )
            )
        numbers, estimated, covariance, share, mean, true_pose, motions, counted, distance, looks = (
            zip(*rows, strict=True) if rows else [()] * 10
        )
        row, log, frames, stamps = np.array(numbers, dtype=np.int64).reshape(-1, 4).T
        collisions, place, reference = np.array(counted, dtype=np.int64).reshape(-1, 3).T
        similarity, visual_distance, turn = np.array(looks, dtype=np.float64).reshape(-1, 3).T
        return self.Out(
            drive=Drive(
                row=row,
                log=log,
                frames=frames,
                stamps=stamps,
                estimate=np.array(estimated, dtype=np.float64).reshape(-1, 3),
                covariance=np.array(covariance, dtype=np.float64).reshape(-1, 3, 3),
                mode_weight=np.array(share, dtype=np.float64),
                mean=np.array(mean, dtype=np.float64).reshape(-1, 3),
                truth=np.array(true_pose, dtype=np.float64).reshape(-1, 3),
                motion=np.array(motions, dtype=np.float64).reshape(-1, 3),
                collisions=collisions,
                distance=np.array(distance, dtype=np.float64),
                place=place,
                reference=reference,
                similarity=similarity,
                visual_distance=visual_distance,
                reference_turn=turn,
            )
        )

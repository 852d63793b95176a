"""Collects what every metric and plot of a drive needs."""

import math
from array import array
from collections.abc import Sequence

import numpy as np

from omninav.pipeline import Context, Outputs, Stage, Tick
from omninav.stages.values.belief import PoseEstimate
from omninav.stages.values.confidence import TRACKING_STATES, PoseConfidence
from omninav.stages.values.drive import EVIDENCE, Drive, pose_row
from omninav.stages.values.episode_statistics import EpisodeStatistics
from omninav.stages.values.evidence import ImageEvidence
from omninav.stages.values.pose import Motion, Pose
from omninav.stages.values.similarity import BestMatch


class CollectDrive(Stage):
    """Collects ticks, estimates, ground truth, odometry, matches and evidence of a whole run, a row per tick."""

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
        tallies: Sequence[EpisodeStatistics | None] | None = None,
        matches: Sequence[BestMatch | None] | None = None,
        confidences: Sequence[PoseConfidence | None] | None = None,
        evidence: Sequence[ImageEvidence | None] | None = None,
    ) -> Out:
        """The whole run at once. Each sequence is read once, in order."""
        whole, parts = array("q"), array("d")  # not lists: a long run has many rows
        conflicts: dict[str, int] = {}
        absent = [None] * len(ticks)
        for row, (tick, estimate, true, moved, tally, match, confidence, measured) in enumerate(
            zip(
                ticks,
                absent if estimates is None else estimates,
                truth,
                motion,
                absent if tallies is None else tallies,
                absent if matches is None else matches,
                absent if confidences is None else confidences,
                absent if evidence is None else evidence,
                strict=True,
            )
        ):
            whole.extend((row, tick.log, tick.frame, tick.stamp, 0 if tally is None else tally.collisions))
            whole.append(-1 if estimate is None or estimate.place is None else estimate.place)
            whole.append(-1 if match is None else match.reference)
            parts.extend(pose_row(estimate.pose if estimate else None))
            parts.extend([math.nan] * 9 if estimate is None else np.ravel(estimate.covariance).tolist())
            parts.append(0.0 if estimate is None else estimate.mode_weight)
            parts.extend(pose_row(estimate.mean if estimate else None))
            parts.extend(pose_row(true))
            parts.extend((math.nan,) * 3 if moved is None else (moved.x, moved.y, moved.turn))
            parts.append(math.nan if tally is None else tally.distance)
            looked = (None,) * 3 if match is None else (match.similarity, match.distance, match.turn)
            parts.extend(math.nan if value is None else value for value in looked)
            parts.append(math.nan if confidence is None else confidence.probability)
            whole.append(-1 if confidence is None else TRACKING_STATES.index(confidence.state))
            numbers = (None if measured is None else getattr(measured, name) for name in EVIDENCE)
            parts.extend(math.nan if value is None else value for value in numbers)
            said = "" if measured is None else measured.conflict
            whole.append(conflicts.setdefault(said, len(conflicts)) if said else -1)
        counts = np.array(whole, np.int64).reshape(-1, 9).T.copy()
        row_of, log, frames, stamps, collisions, place, reference, state, conflict_of = counts
        columns = np.array(parts, np.float64).reshape(-1, 27 + len(EVIDENCE))
        estimated, covariance, weight, mean, true_pose, motions, distance, looks, trusted, numbers_of = (
            np.ascontiguousarray(part) for part in np.split(columns, (3, 12, 13, 16, 19, 22, 23, 26, 27), axis=1)
        )
        similarity, visual_distance, turn = looks.T.copy()
        return self.Out(
            drive=Drive(
                row=row_of,
                log=log,
                frames=frames,
                stamps=stamps,
                estimate=estimated,
                covariance=covariance.reshape(-1, 3, 3),
                mode_weight=weight.ravel(),
                mean=mean,
                truth=true_pose,
                motion=motions,
                collisions=collisions,
                distance=distance.ravel(),
                place=place,
                reference=reference,
                similarity=similarity,
                visual_distance=visual_distance,
                reference_turn=turn,
                confidence=trusted.ravel(),
                evidence=numbers_of,
                state=state,
                conflict=conflict_of,
                conflicts=tuple(conflicts),
            )
        )

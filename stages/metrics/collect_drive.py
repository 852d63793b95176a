"""Collects what every metric and plot of a drive needs."""

import dataclasses
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from omninav.pipeline import Context, Outputs, Stage, Tick, counted
from omninav.stages.geometry.arrays import Ints
from omninav.stages.values.belief import PoseEstimate
from omninav.stages.values.confidence import TRACKING_STATES, PoseConfidence
from omninav.stages.values.drive import EVIDENCE, Drive, known, pose_row
from omninav.stages.values.episode_statistics import EpisodeStatistics
from omninav.stages.values.evidence import ImageEvidence
from omninav.stages.values.maps import ReferenceGraph
from omninav.stages.values.pose import OWN_FRAMES, SOURCE_WORDS, Motion, Pose
from omninav.stages.values.similarity import BestMatch
from omninav.stages.values.visual_words import PlaceWords

from .map_frame import in_map_frame

POSES = ("estimate", "mean", "truth", "motion")
SHAPES = {"covariance": (3, 3), "evidence": (len(EVIDENCE),), **dict.fromkeys(POSES, (3,))}
ROW = np.dtype(
    [
        (column.name, np.int64 if column.type == Ints else np.float64, SHAPES.get(column.name, ()))
        for column in dataclasses.fields(Drive)
        if column.name != "conflicts"
    ]
)
"""A row of a `Drive`, its columns in their order."""
NOT_KNOWN = (None,) * 3
MAX_WITHOUT_TRUTH = 0.1
"""Share of images without a true pose of which nothing is said."""
AT_ORIGIN = (0.05, 0.05, 0.05)
"""Largest x, y (m) and heading (rad) of a first estimate at which a map is begun (0.01 m and 0.5 degrees)."""
ALIGNED = "the true poses were aligned with the estimates by one rigid motion, and errors are those after alignment"


class CollectDrive(Stage):
    """Collects ticks, estimates, ground truth, odometry, matches and evidence of a whole run, a row per tick."""

    class Out(Outputs):
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
        map: ReferenceGraph | PlaceWords | None = None,
    ) -> Out:
        """The whole run at once. Each sequence is read once, in order.

        It aligns true poses with a map whose own poses are not true ones (`in_map_frame`), with a warning.
        """
        absent = [None] * len(ticks)
        looked: list[Sequence[Any]] = [
            absent if each is None else each for each in (estimates, tallies, matches, confidences, evidence)
        ]
        conflicts: dict[str, int] = {}

        def rows() -> Iterator[tuple[Any, ...]]:  # None becomes NaN
            together = zip(ticks, truth, motion, *looked, strict=True)
            for row, (tick, true, moved, estimate, tally, match, confidence, measured) in enumerate(together):
                said = "" if measured is None else measured.conflict
                yield (
                    *(row, tick.log, tick.frame, tick.stamp),
                    pose_row(estimate.pose if estimate else None),
                    np.full((3, 3), np.nan) if estimate is None else estimate.covariance,
                    0.0 if estimate is None else estimate.mode_weight,
                    pose_row(estimate.mean if estimate else None),
                    pose_row(true),
                    NOT_KNOWN if moved is None else (moved.x, moved.y, moved.turn),
                    *((0, None) if tally is None else (tally.collisions, tally.distance)),
                    -1 if estimate is None or estimate.place is None else estimate.place,
                    -1 if match is None else match.reference,
                    *(NOT_KNOWN if match is None else (match.similarity, match.distance, match.turn)),
                    None if confidence is None else confidence.probability,
                    tuple(getattr(measured, name, None) for name in EVIDENCE),
                    -1 if confidence is None else TRACKING_STATES.index(confidence.state),
                    conflicts.setdefault(said, len(conflicts)) if said else -1,
                )

        table = np.fromiter(rows(), ROW)  # not a list: a long run has many rows
        columns: dict[str, Any] = {name: np.ascontiguousarray(table[name]) for name in ROW.names or ()}
        if map is not None and map.pose_source in OWN_FRAMES and np.isfinite(columns["truth"]).any():
            columns["truth"] = in_map_frame(columns["truth"], columns["estimate"])
            ctx.warn(f"The map's poses are from {SOURCE_WORDS[map.pose_source]}, in a frame of their own: {ALIGNED}")
        self._late_truth(ctx, columns, map is None)
        return self.Out(drive=Drive(**columns, conflicts=tuple(conflicts)))

    def _late_truth(self, ctx: Context, columns: dict[str, Any], begins_its_map: bool) -> None:
        """Align with a map that was begun at the origin before the first true pose; warn where many have none."""
        has = known(columns["truth"])
        if has.any() and begins_its_map and not has[0] and (np.abs(columns["estimate"][0]) < AT_ORIGIN).all():
            columns["truth"] = in_map_frame(columns["truth"], columns["estimate"])
            ctx.warn(f"The map is begun at the origin, before the first true pose: {ALIGNED}")
        without = int((~has).sum())
        if has.any() and without > MAX_WITHOUT_TRUTH * len(has):
            ctx.warn(f"{without} of {counted(len(has), 'image')} have no true pose: errors are those of the others")

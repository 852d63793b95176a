"""Number and accuracy of the features that two images of a homing drive share, matched again or tracked."""

import math
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

from omninav.pipeline import Context, Metrics, MetricSpec, MetricStage
from omninav.stages.geometry.arrays import Array, Bools
from omninav.stages.geometry.plane.se2 import between
from omninav.stages.geometry.two_views.epipolar import shared_residuals, turn_about_vertical
from omninav.stages.values.correspondences import Correspondences
from omninav.stages.values.drive import Drive, known
from omninav.stages.values.homing import LOST, HomingTarget, LocalMap, TrackedFeatures
from omninav.stages.values.local_features import LocalFeatures

from .true_matches import right_by_epipolar

SPECS = {
    "pairs.kept": MetricSpec(title="Right tracks / right matches", better="higher"),
    "pairs.matched.right": MetricSpec(title="Right matches of a local map", better="higher"),
    "pairs.tracked.right": MetricSpec(title="Right tracks in a local map's last image", better="higher"),
    "pairs.matched.noise_deg": MetricSpec(title="Angle by which right matches miss the epipolar plane", better="lower"),
    "pairs.tracked.noise_deg": MetricSpec(title="Angle by which right tracks miss the epipolar plane", better="lower"),
}
RIGHT_DEG = 1.0
"""Largest angle of a pair to the true epipolar plane that is right, degrees."""
APART_M = 0.3
"""Distance below which two images are not compared, metres: a map that was not tracked so far has no tracks."""


class JudgedBearings(NamedTuple):
    """Pairs of bearings of two images taken `metres` apart, one for each feature of a map.

    `angles` (N,), degrees, by which the two together miss a common plane with the baseline, and which of them are
    `right` (N,); NaN and False where there is no pair.
    """

    metres: float
    angles: Array
    right: Bools


class MatchedAndTracked(MetricStage):
    """Compares the matched pairs from which a local map was triangulated with the same features as they are tracked.

    Goedemé et al. 2007, section 7.1.2, where matches of the first and the target image are called "more plentiful and
    less influenced by noise" than tracked features. Matches: between the image in which the map was made and the
    target's, which was taken at the drive's first pose. Tracks: between the same image and the last in which the map
    was tracked, without those that contradict the robot's pose then, and without features that were matched again on
    the way. Every map that was made `APART_M` from the target or farther counts.

    A pair is right where its bearings are within `RIGHT_DEG` of a plane with the true baseline and meet in front of
    both views; errors along that plane are not seen. Under `pairs`: `maps`, how many; for `matched` and `tracked` each
    `used` and `right`, per map, `noise_deg`, the median angle of the features that are right as both, and `apart_m`,
    the mean distance of the two images; `kept`, right tracks over right matches; `noise_ratio`, the noise of matches
    over that of tracks. Nothing where no map was made, or without truth.
    """

    def step(
        self,
        ctx: Context,
        drive: Drive,
        maps: Sequence[LocalMap | None],
        tracks: Sequence[TrackedFeatures | None],
        targets: Sequence[HomingTarget | None],
        features: Sequence[LocalFeatures | None],
        correspondences: Sequence[Correspondences | None],
    ) -> MetricStage.Out:
        """The whole run at once; `tracks` are the tracker's, `correspondences` those of `features` and the target's."""
        poses = drive.truth
        if not len(poses) or not known(poses).all():
            return self.Out()
        matched, tracked = [], []
        for begun, ticks in spans(maps, tracks):
            made, target, seen, pairs = maps[begun], targets[begun], features[begun], correspondences[begun]
            home = between(poses[begun], poses[0])
            if made is None or target is None or seen is None or pairs is None or metres(home) < APART_M:
                continue
            partner = dict(zip(pairs.second.tolist(), pairs.first.tolist(), strict=True))
            here = seen.point_bearings()[[partner[row] for row in made.rows.tolist()]]
            matched.append(self._judged(here, target.features.point_bearings()[made.rows], home))
            tracked.append(self._tracked(begun, ticks, poses, maps, tracks, len(made)))
        if not matched:
            return self.Out()
        right, still = sum(int(each.right.sum()) for each in matched), sum(int(each.right.sum()) for each in tracked)
        both = np.concatenate([one.right & other.right for one, other in zip(matched, tracked, strict=True)])
        values: dict[str, Any] = {
            "maps": len(matched),
            "matched": _summary(matched, both),
            "tracked": _summary(tracked, both),
            "kept": still / right if right else None,
        }
        noise, other = values["matched"]["noise_deg"], values["tracked"]["noise_deg"]
        values["noise_ratio"] = noise / other if noise is not None and other else None
        return self.Out(metrics=Metrics({"pairs": values}, SPECS, ("pairs.kept",)))

    def _tracked(
        self,
        begun: int,
        ticks: Sequence[int],
        poses: Array,
        maps: Sequence[LocalMap | None],
        tracks: Sequence[TrackedFeatures | None],
        number: int,
    ) -> JudgedBearings:
        none = JudgedBearings(math.nan, np.full(number, np.nan), np.zeros(number, np.bool_))
        if not ticks:
            return none
        start, end, last = tracks[ticks[0]], tracks[ticks[-1]], maps[ticks[-1]]
        moved = between(poses[begun], poses[ticks[-1]])
        if start is None or end is None or last is None or metres(moved) < APART_M:
            return none
        # The tracker lays each place along the bearing of the point that it tracks, in the image the map was made in.
        held = (end.kinds != LOST) & (last.kinds != LOST) & np.isfinite(end.bearings).all(axis=1)
        held &= (start.places == end.places).all(axis=1)
        here = end.places / np.linalg.norm(end.places, axis=1, keepdims=True)
        found = self._judged(here[held], end.bearings[held], moved)
        none.angles[held], none.right[held] = found.angles, found.right
        return none._replace(metres=found.metres)

    def _judged(self, first: Array, second: Array, moved: Array) -> JudgedBearings:
        """Bearings (N, 3) of two images, the second taken at `moved` (3,) as seen from the first."""
        x, y, turn = (float(each) for each in moved)
        way = np.array([x, y, 0.0]) / metres(moved)
        angles = np.degrees(shared_residuals(turn_about_vertical(turn), way, first, second))
        right = right_by_epipolar(first, second, (x, y, turn), math.radians(RIGHT_DEG))
        return JudgedBearings(metres(moved), angles, right)


def spans(maps: Sequence[LocalMap | None], tracks: Sequence[TrackedFeatures | None]) -> Iterator[tuple[int, list[int]]]:
    """Every local map that was made, in their order: the tick in which it was, and those in which it was tracked."""
    made = {each.number: k for k, each in enumerate(maps) if each is not None and each.state == "new"}
    for number, begun in made.items():
        yield (
            begun,
            [
                k
                for k, (each, track) in enumerate(zip(maps, tracks, strict=True))
                if each is not None and each.number == number and each.state == "tracking"
                if track is not None and track.number == number
            ],
        )


def metres(motion: Array) -> float:
    """Length of a motion (3,)."""
    return math.hypot(motion[0], motion[1])


def _summary(judged: Sequence[JudgedBearings], both: Bools) -> dict[str, float | None]:
    angles = np.concatenate([each.angles for each in judged])
    apart = [each.metres for each in judged if math.isfinite(each.metres)]
    return {
        "used": int(np.isfinite(angles).sum()) / len(judged),
        "right": sum(int(each.right.sum()) for each in judged) / len(judged),
        "noise_deg": float(np.median(angles[both])) if both.any() else None,
        "apart_m": float(np.mean(apart)) if apart else None,
    }

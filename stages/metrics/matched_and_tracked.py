"""How many features two images of a homing drive share, and how exactly: matched, or tracked from one to the other."""

import math
from collections.abc import Sequence
from typing import Annotated, Any, NamedTuple

import numpy as np
import numpy.typing as npt

from omninav.pipeline import Bounds, Context, Metrics, Outputs, Quantity, Stage
from omninav.stages.geometry.plane.se2 import between
from omninav.stages.geometry.two_views.epipolar import shared_residuals, turn_about_vertical
from omninav.stages.values.correspondences import Correspondences
from omninav.stages.values.drive import Drive, known
from omninav.stages.values.homing import LOST, HomingTarget, LocalMap, TrackedFeatures
from omninav.stages.values.local_features import LocalFeatures

Array = npt.NDArray[np.float64]
QUANTITIES = {
    "pairs.matched.right": Quantity(title="Matches of the first and the target image, right", better="higher"),
    "pairs.matched.noise_deg": Quantity(title="… their median distance from the epipolar plane", better="lower"),
    "pairs.tracked.right": Quantity(title="Features tracked from the first to the last image, right", better="higher"),
    "pairs.tracked.noise_deg": Quantity(title="… their median distance from the epipolar plane", better="lower"),
}


class Judged(NamedTuple):
    """Pairs of bearings of two images taken `metres` apart, and by how many degrees each misses the epipolar plane."""

    metres: float
    degrees: Array


class MatchedAndTracked(Stage):
    """Compares the matches of two images, of which local maps are made, with what is tracked from one of them on.

    Goedemé et al. 2007, section 7.1.2, where matches of the first and the target image are called "more plentiful and
    less influenced by noise" than tracked features. Of every local map that was tracked over `apart_m` at least: the
    features that it was made of, between the image then and the target's, which was taken at the drive's first pose;
    and the tracks that agree with the robot's pose, between the image then and the last in which it was tracked. Of
    both kinds every pair's angle to the true epipolar plane is taken.

    Under `pairs`: `maps`, how many; for `matched` and `tracked` each `used` and `right` (those within `right_deg`), per
    map; `noise_deg`, the median angle of all that are right; `apart_m`, how far apart the two images were taken on
    average. `more`: right matches over right tracks; `noise_ratio`: the noise of matches over that of tracks. Nothing
    where no map was tracked so far, or without truth.
    """

    right_deg: Annotated[float, Bounds(gt=0)] = 1.0
    """Largest angle (degrees) to the true epipolar plane of a pair that is right: the local map's limit for matches."""
    apart_m: Annotated[float, Bounds(gt=0)] = 0.3
    """Smallest distance (m) between two images that have epipolar planes."""

    class Out(Outputs):
        """`metrics`: the entry `pairs` of metrics.json, absent where there is nothing to compare."""

        metrics: Metrics | None = None

    def step(
        self,
        ctx: Context,
        drive: Drive,
        maps: Sequence[LocalMap | None],
        tracks: Sequence[TrackedFeatures | None],
        targets: Sequence[HomingTarget | None],
        features: Sequence[LocalFeatures | None],
        correspondences: Sequence[Correspondences | None],
    ) -> Out:
        """The whole run at once; `tracks` are the tracker's, `correspondences` those of `features` and the target's."""
        poses = drive.truth
        if not len(poses) or not known(poses).all():
            return self.Out()
        matched, tracked = [], []
        for begun, ended in _spans(maps):
            new, last, track = maps[begun], maps[ended], tracks[ended]
            target, seen, pairs = targets[begun], features[begun], correspondences[begun]
            assert new is not None
            assert last is not None
            assert target is not None
            assert seen is not None
            assert pairs is not None
            home, moved = between(poses[begun], poses[0]), between(poses[begun], poses[ended])
            if track is None or track.number != new.number or min(_metres(home), _metres(moved)) < self.apart_m:
                continue
            used = np.isin(pairs.second, new.rows)
            here, there = seen.point_bearings()[pairs.first], target.features.point_bearings()[pairs.second]
            matched.append(Judged(_metres(home), _angles_deg(here[used], there[used], home)))
            held = (track.kinds != LOST) & (last.kinds != LOST) & np.isfinite(track.bearings).all(axis=1)
            # The map's origin is where it was made, so that its places lie along the bearings of that image.
            here = track.places[held] / np.linalg.norm(track.places[held], axis=1, keepdims=True)
            tracked.append(Judged(_metres(moved), _angles_deg(here, track.bearings[held], moved)))
        if not matched:
            return self.Out()
        values: dict[str, Any] = {
            "maps": len(matched),
            "matched": self._summary(matched),
            "tracked": self._summary(tracked),
        }
        one, other = values["matched"], values["tracked"]
        values["more"] = one["right"] / other["right"] if other["right"] else None
        known_noise = one["noise_deg"] is not None and other["noise_deg"]
        values["noise_ratio"] = one["noise_deg"] / other["noise_deg"] if known_noise else None
        headlines = ("pairs.matched.right", "pairs.tracked.right")
        return self.Out(metrics=Metrics({"pairs": values}, QUANTITIES, headlines))

    def _summary(self, judged: Sequence[Judged]) -> dict[str, float | int | None]:
        degrees = np.concatenate([each.degrees for each in judged])
        right = degrees[degrees <= self.right_deg]
        return {
            "used": len(degrees) / len(judged),
            "right": len(right) / len(judged),
            "noise_deg": float(np.median(right)) if len(right) else None,
            "apart_m": float(np.mean([each.metres for each in judged])),
        }


def _spans(maps: Sequence[LocalMap | None]) -> list[tuple[int, int]]:
    """Of each local map that was tracked: the tick in which it was made, and the last in which it was tracked."""
    begun: dict[int, int] = {}
    ended: dict[int, int] = {}
    for k, each in enumerate(maps):
        if each is not None and each.state == "new":
            begun[each.number] = k
        elif each is not None and each.state == "tracking":
            ended[each.number] = k
    return [(begun[number], ended[number]) for number in ended if number in begun]


def _metres(motion: Array) -> float:
    return math.hypot(motion[0], motion[1])


def _angles_deg(first: Array, second: Array, moved: Array) -> Array:
    # Of two images' bearings (N, 3); the second was taken at `moved` (3,), as seen from the first.
    way = np.array([moved[0], moved[1], 0.0]) / _metres(moved)
    return np.degrees(shared_residuals(turn_about_vertical(float(moved[2])), way, first, second))

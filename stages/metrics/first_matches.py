"""Counts matches of two views that are right before the first wrong one."""

import math
from collections.abc import Callable, Sequence
from functools import partial
from typing import Annotated, Any, Literal, NamedTuple

import numpy as np

from omninav.pipeline import BadInput, Bounds, Context, Metrics, MetricSpec, MetricStage
from omninav.stages.camera.model import Camera
from omninav.stages.geometry.appearance.feature_matching import NO_PAIRS, Pairs, mahalanobis_matches, one_way_matches
from omninav.stages.geometry.appearance.visual_distance import ComparisonOptions, PatchDistance, match_patches
from omninav.stages.geometry.arrays import Array, Bools
from omninav.stages.geometry.plane.mount import camera_step
from omninav.stages.geometry.plane.se2 import between
from omninav.stages.geometry.two_views.triangulation import angles_between
from omninav.stages.values.depths import Depths
from omninav.stages.values.local_features import LocalFeatures, VerticalSegments
from omninav.stages.values.pose import Pose

from .true_matches import Motion, right_by_depth, right_by_epipolar

COLUMN_RATIO = 0.8
"""Largest ratio of the nearest to the second nearest distance of vertical segments that match."""
COLUMN_WITHIN_DEG = 3.0
"""Largest angle by which a right match of vertical segments may miss the true bearings of their ends, degrees."""
WITHIN_DEG = 2.0
"""Largest angle between a patch and where its partner's point is seen, degrees."""
EPIPOLAR_DEG = 1.0
"""Largest angle to the epipolar plane, where depths are not known, degrees."""


class JudgedMatches(NamedTuple):
    """A pair of images: which of its matches are `right`, the best first; the share of wrong partners that pass as
    right `by_chance`; how many `features` of the first image could be found again."""

    right: Bools
    by_chance: float
    features: int


class Seen(NamedTuple):
    """An image's pose, its features, and their depths."""

    pose: Array
    patches: LocalFeatures | None
    columns: VerticalSegments | None
    depths: Depths | None


APART_M = (0.5, 1.0, 2.0)
"""Distances between the images of a pair, metres."""
SPECS = {
    "matches.all.right_share": MetricSpec(title="Matches, share right", unit="%", better="higher"),
    "matches.all.first_right": MetricSpec(title="Matches right before the first wrong one, median", better="higher"),
    "matches.all.found_again": MetricSpec(title="Features found again", unit="%", better="higher"),
    "matches.all.right": MetricSpec(title="Matches right, median", better="higher"),
    "matches.all.by_chance": MetricSpec(title="Matches with wrong images that pass as right", unit="%"),
    "matches.all.pairs": MetricSpec(title="Pairs of images", context=True),
}


class FirstMatches(MetricStage):
    """Counts how many matches of pairs of images are right, from the best to the worst, up to the first wrong one.

    Goedemé et al. 2007, section 3.2: of a pair "the first 13 matches are correct". The first image of each pair is
    evenly along the log, the second is the next one that was taken a given distance away (straight).

    A match of patches is right where its point, by its depth in one view, is seen in the other close to its partner, or
    within half the patch's diameter, if that is more; one of columns where both of its ends are. Without depths: where
    its bearings are close to a plane with the direction of travel and meet in front of both views. Under `matches`, by
    distance and over `all`: `matched`, `first_right` and `right` (medians over pairs), `right_share`; `found_again`:
    the share of the first images' features that a right match finds in the second; `by_chance`: the share of wrong
    partners that would be counted as right. Raises BadInput where no truth states where images were taken.
    """

    pairs: Annotated[int, Bounds(ge=1)] = 30
    """Pairs for each distance."""
    by: Literal["patches", "columns", "both"] = "patches"
    """Features that are matched: patches, vertical segments, or both."""
    search: Literal["both_ways", "one_way"] = "both_ways"
    """`both_ways` (the paper, section 3.4): each other's nearest, clearly nearer than the second of either; `one_way`
    (Lowe): the second view's nearest, clearly nearer than its second."""
    best: Literal["clearest", "nearest"] = "clearest"
    """Order of the matches: the clearest by that ratio first, or the nearest descriptors (not to be compared between
    two kinds)."""
    ratio: Annotated[float, Bounds(gt=0, le=1)] = 0.8
    """Largest ratio of the nearest to the second nearest patch."""
    colour: Annotated[float, Bounds(gt=0)] = 0.5
    """Largest distance between the colours of two patches."""
    patch_distance: PatchDistance = "euclidean"
    """Distance of patches' descriptors in the search both ways: `mahalanobis` is the paper's (equation 2)."""

    def step(
        self,
        ctx: Context,
        truth: Sequence[Pose | None],
        features: Sequence[LocalFeatures | None] = (),
        vertical_segments: Sequence[VerticalSegments | None] = (),
        depths: Sequence[Depths | None] = (),
        camera: Sequence[Camera | None] = (),
        other_features: Sequence[LocalFeatures | None] = (),
        other_segments: Sequence[VerticalSegments | None] = (),
        other_depths: Sequence[Depths | None] = (),
    ) -> MetricStage.Out:
        """The whole log at once. The `other_` ones are of the same places in other light: the second image of each pair
        is one of these, where they are there."""
        there = [row for row, pose in enumerate(truth) if pose is not None]
        if not there:
            raise BadInput("matches: no image of the log has a true pose; use a log with /ground_truth/pose")
        lens = next((each for each in camera if each is not None), None)
        poses = np.array([(pose.x, pose.y, pose.heading) for pose in truth if pose is not None])

        def seen(*described: Sequence[Any]) -> list[Seen]:
            rows = zip(poses, there, strict=True)
            return [Seen(pose, *(each[row] if row < len(each) else None for each in described)) for pose, row in rows]

        views = seconds = seen(features, vertical_segments, depths)
        if other_features or other_segments:
            seconds = seen(other_features, other_segments, other_depths)
        chosen = [pairs_apart(poses, far, self.pairs) for far in APART_M]
        judged = [[self._judged(views[one], seconds[other], lens) for one, other in pairs] for pairs in chosen]
        found: dict[str, Any] = {"depths_known": int(any(view.depths is not None for view in views))}
        found["apart"] = [{"m": far, **summary(pairs)} for far, pairs in zip(APART_M, judged, strict=True)]
        found["all"] = summary([pair for pairs in judged for pair in pairs])
        return self.Out(metrics=Metrics({"matches": found}, SPECS, ("matches.all.right_share",)))

    def _judged(self, one: Seen, other: Seen, lens: Camera | None) -> JudgedMatches:
        moved_robot = between(one.pose, other.pose)
        x, y, turn = (moved_robot if lens is None else camera_step(moved_robot, lens.arm)).tolist()
        moved, features = (x, y, turn), 0
        kinds: list[tuple[Pairs, Callable[[Pairs], Bools]]] = []
        if self.by != "columns" and one.patches is not None and other.patches is not None:
            pairs = self._patches(one.patches, other.patches)
            kinds.append((pairs, partial(self._right_patches, one, other, moved, lens)))
            features += len(one.patches)
        if self.by != "patches" and one.columns is not None and other.columns is not None:
            pairs = mahalanobis_matches(one.columns.descriptors, other.columns.descriptors, COLUMN_RATIO)
            kinds.append((pairs, partial(self._right_columns, one, other, moved)))
            features += len(one.columns)
        if not kinds:
            return JudgedMatches(np.zeros(0, np.bool_), math.nan, 0)
        ratios = [pairs.distance if self.best == "nearest" else pairs.ratio for pairs, _ in kinds]
        order = np.argsort(np.concatenate(ratios), kind="stable")
        rights = np.concatenate([is_right(pairs) for pairs, is_right in kinds])
        chance = np.concatenate([is_right(shifted(pairs)) for pairs, is_right in kinds])
        return JudgedMatches(rights[order], float(chance.mean()) if len(chance) else math.nan, features)

    def _patches(self, one: LocalFeatures, other: LocalFeatures) -> Pairs:
        if self.search == "both_ways":
            options = ComparisonOptions(self.ratio, max_colour_distance=self.colour, patch_distance=self.patch_distance)
            return match_patches(one.patches(), other.patches(), options)
        if not len(one) or not len(other):
            return NO_PAIRS
        pairs = one_way_matches(one.descriptors, other.descriptors, self.ratio)
        apart = np.linalg.norm(one.colours[pairs.first] - other.colours[pairs.second], axis=1)
        return pairs.chosen(apart <= self.colour)

    def _right_patches(self, one: Seen, other: Seen, moved: Motion, lens: Camera | None, pairs: Pairs) -> Bools:
        assert one.patches is not None
        assert other.patches is not None
        first, second = one.patches.bearings[pairs.first], other.patches.bearings[pairs.second]
        if one.depths is None or other.depths is None:
            return right_by_epipolar(first, second, moved, math.radians(EPIPOLAR_DEG))
        limit = np.full(len(first), math.radians(WITHIN_DEG))
        if lens is not None:
            limit = np.maximum(limit, half_widths(one.patches, lens)[pairs.first])
        near, far = one.depths.patches[pairs.first], other.depths.patches[pairs.second]
        return right_by_depth(first, second, near, far, moved, limit)

    def _right_columns(self, one: Seen, other: Seen, moved: Motion, pairs: Pairs) -> Bools:
        assert one.columns is not None
        assert other.columns is not None
        right = np.ones(len(pairs.first), np.bool_)
        first, second = one.columns.bearings()[pairs.first], other.columns.bearings()[pairs.second]
        for end in (0, 1):
            if one.depths is None or other.depths is None:
                limit = math.radians(EPIPOLAR_DEG)
                right &= right_by_epipolar(first[:, end], second[:, end], moved, limit)
            else:
                near, far = one.depths.ends[pairs.first, end], other.depths.ends[pairs.second, end]
                limit = math.radians(COLUMN_WITHIN_DEG)
                right &= right_by_depth(first[:, end], second[:, end], near, far, moved, limit)
        return right


def pairs_apart(poses: Array, metres: float, number: int) -> list[tuple[int, int]]:
    """Up to `number` pairs of images: the first evenly along the log, the second the next taken `metres` from it."""
    found = []
    for row in range(len(poses)):
        after = np.flatnonzero(np.hypot(*(poses[row:, :2] - poses[row, :2]).T) >= metres)
        if len(after):
            found.append((row, row + int(after[0])))
    if not found:
        return []
    return [found[row] for row in np.unique(np.linspace(0, len(found) - 1, number).round().astype(np.int64))]


def shifted(pairs: Pairs) -> Pairs:
    """The same features with the partners of others: all wrong, but for chance."""
    return pairs._replace(second=np.roll(pairs.second, max(1, len(pairs.second) // 2)))


def half_widths(features: LocalFeatures, camera: Camera) -> Array:
    """Half of each patch's diameter as an angle (N,), rad: the less of across and down the image."""
    reach = features.sizes[:, None].astype(np.float64) / 2.0
    widths = [
        angles_between(features.bearings, camera.unproject(features.points + reach * np.array(step))[0])
        for step in ((1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.0, -1.0))
    ]
    widest = np.nanmin(np.where(np.isfinite(widths), widths, math.inf), axis=0)
    return np.where(np.isfinite(widest), widest, 0.0)


def run_of_right(right: Bools) -> int:
    """Number of right ones before the first wrong one; all, where none is wrong."""
    wrong = np.flatnonzero(~right)
    return int(wrong[0]) if len(wrong) else len(right)


def summary(pairs: Sequence[JudgedMatches]) -> dict[str, float | int | None]:
    """Judgement of some pairs; None where there are none."""
    if not pairs:
        names = ("matched", "first_right", "right", "right_share", "found_again", "by_chance")
        return {"pairs": 0, **dict.fromkeys(names)}
    chances = np.array([pair.by_chance for pair in pairs])
    matched, features = sum(len(pair.right) for pair in pairs), sum(pair.features for pair in pairs)
    right = sum(int(pair.right.sum()) for pair in pairs)
    return {
        "pairs": len(pairs),
        "matched": float(np.median([len(pair.right) for pair in pairs])),
        "first_right": float(np.median([run_of_right(pair.right) for pair in pairs])),
        "right": float(np.median([np.count_nonzero(pair.right) for pair in pairs])),
        "right_share": right / matched if matched else None,
        "found_again": right / features if features else None,
        "by_chance": float(np.nanmean(chances)) if np.isfinite(chances).any() else None,
    }

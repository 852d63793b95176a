"""A local map of the features around the robot, and the robot's pose in it."""

import math
from dataclasses import field, replace
from typing import Annotated, Literal, NamedTuple

import numpy as np

from omninav.pipeline import BadInput, Bounds, Context, Outputs, Stage, State
from omninav.stages.camera.model import Camera
from omninav.stages.geometry.arrays import Array, Ints
from omninav.stages.geometry.plane.mount import MIN_ARM_M
from omninav.stages.geometry.plane.se2 import compose, wrap_angle
from omninav.stages.geometry.two_views.absolute_pose import three_point_pose
from omninav.stages.geometry.two_views.epipolar import yaw_of
from omninav.stages.geometry.two_views.ransac import AgreedPose
from omninav.stages.geometry.two_views.relative_pose_ransac import Solver, false_alarms, relative_pose
from omninav.stages.geometry.two_views.triangulation import parallax, triangulate
from omninav.stages.values.correspondences import Correspondences
from omninav.stages.values.homing import LOST, MATCHED, HomingTarget, LocalMap, TrackedFeatures
from omninav.stages.values.local_features import LocalFeatures
from omninav.stages.values.pose import Motion

from .camera_motion import camera_motion
from .vertical import levelling, seen_leaning, vertical_of

MIN_MAP_MOTION, MIN_ODOMETRY_M = 0.1, 0.05
"""Distances since the map was made, in its unit and in metres, from which they are compared for the unit in metres."""
MAX_EPIPOLAR_ERROR_DEG = 1.0
"""Largest angle by which the two bearings of a feature may together miss the relative pose, degrees."""
MAX_RESECTION_ERROR_DEG = 2.0
"""Largest angle by which a bearing may miss its feature's position in the map, degrees."""
MIN_PARALLAX_DEG = 1.0
"""Smallest parallax of a feature that is triangulated, degrees."""
REBUILD_RATIO = 1.5
"""Ratio of matches to the first inliers from which the map is rebuilt, if as many agree."""
ARRIVAL_DISTANCE = 0.05
"""Distance to the target, over the features' typical distance, below which the two views must look the same."""
MAX_OUTLIER_DEG = 3.0
"""Largest angle between most matched bearings at the target, after the turn, degrees; twice the depth ratio is added,
as half of the features are closer than a typical one."""
SAME_SHARE, SAME_SHARE_AT_TARGET, AT_TARGET = 0.5, 0.7, 0.03
"""Share of the matches that must have the target's bearings; and the share from this distance on, over the features'
typical distance, at which the robot may stop: in 20 development drives 98 % of the images there have 0.77 and more, and
those of four drives that stopped elsewhere 0.5 to 0.68 (docs/experiments/atlas.md)."""
SECTORS, MIN_IN_SECTOR, SHOWN_OF_SECTOR, SHOWN_SECTORS = 12, 4, 0.2, 0.6
"""Sectors of azimuth at the target, features of the target in one that count, and the share of them that must have the
target's bearings in this share of the sectors: in development drives at least 0.67 of the sectors show that at the
target, and at most 0.5 where a piece of furniture was mistaken for a similar one (docs/experiments/atlas.md)."""
MIN_INLIERS = 6
"""Features that must agree with a pose."""
MIN_REBUILD_DISTANCE = 0.1
"""Distance to the target, over the features' typical distance, below which the baseline is too short for a new map."""

MIN_VERIFIED_INLIERS = 14
"""Features that must agree in each of two images before the robot relies on a target: none of 3,980 pairs hidden
behind walls has this many, but 13 of 2,420 of places with the same walls do (docs/experiments/
topological_nav_homing_vectors.md)."""
MIN_BASELINE_M = 0.2
"""Distance between the two images by odometry, metres: the same image twice would confirm the same false matches."""
MAX_DOUBTFUL_M = 0.6
"""Way after which a doubtful map that no image has shown again, and a witness, are forgotten, metres."""
MAX_JUMP_M = 0.2
"""Largest distance of the robot's place from where odometry leads, from one image to the next, metres: in development
drives 98 % of the right places are within 0.07, and all beyond 0.2 are wrong (docs/experiments/atlas.md)."""
MAX_REFUTED_M = 3.0
"""Way after which features that led to another place may make a map again, metres."""
MAX_HEADING_DIFFERENCE_DEG = 5.0
"""Largest difference of the target's headings by both, degrees."""
LEANING_GAIN, LEVEL_SHARE = 1.5, 0.5
"""Factor by which more matches must agree with a pose of a camera that leans than with one of an upright camera, and
the share of all matches that may agree with the latter: from there on nothing is asked."""
SAME_VERTICAL_DEG, MAX_VERTICALS = 1.0, 20
"""Largest angle between two verticals that confirm each other, degrees, and how many are remembered."""


class Matches(NamedTuple):
    """Features that were matched with the target view: bearings and pixels here, bearings and rows there.

    `here` and `there`: bearings of all features, matched or not.
    """

    first: Array
    points: Array
    second: Array
    rows: Ints
    here: Array
    there: Array


NO_BEARINGS = np.zeros((0, 3))
NO_ROWS = np.zeros(0, np.int64)
NO_MATCHES = Matches(NO_BEARINGS, np.zeros((0, 2)), NO_BEARINGS, NO_ROWS, NO_BEARINGS, NO_BEARINGS)


class LocalMappingState(State):
    """The local map of the tick before, and how many were made.

    Of the target with the number `target`: `doubtful`, the best such map, moved on by odometry; `witness`, its heading
    (rad) in the robot's frame by a relative pose that enough features agreed with. None: there was none. `since` (3,):
    odometry since the witness (m, m, rad); `unseen_m`: way since the witness on which the target was not found.
    `refuted`: rows of its features that led to another place; `refuted_m`: way since the last time they did.
    `vertical` (3,): of the camera's frame, once two images show that it leans; `leaning` (V, 3): what images showed.
    """

    map: LocalMap | None = None
    made: int = 0
    target: int = -1
    doubtful: LocalMap | None = None
    witness: float | None = None
    since: Array = field(default_factory=lambda: np.zeros(3))
    unseen_m: float = 0.0
    refuted: Ints = field(default_factory=lambda: NO_ROWS)
    refuted_m: float = 0.0
    vertical: Array = field(default_factory=lambda: np.array([0.0, 0.0, 1.0]))
    leaning: Array = field(default_factory=lambda: np.zeros((0, 3)))

    def level(self, ctx: Context, vertical: Array | None) -> None:
        """Take a vertical (3,) that two images show for the camera's, once another two have shown the same."""
        if vertical is None:
            return
        same = self.leaning @ vertical > math.cos(math.radians(SAME_VERTICAL_DEG))
        if same.any():
            mean = vertical + self.leaning[same].sum(axis=0)
            self.vertical = mean / np.linalg.norm(mean)
            tilt = math.degrees(math.acos(min(1.0, self.vertical[2])))
            ctx.warn(f"two images show that the camera leans by {tilt:.1f} degrees, for which homing allows")
        self.leaning = np.vstack([self.leaning, vertical])[-MAX_VERTICALS:]


class LocalMapping(Stage):
    """Places the robot and the target view among the features that both views have in common.

    Goedemé et al. 2007, section 7.2. At a new target the bearings of the matched features give the relative pose of
    the two views, and the features' positions follow by triangulation. Only a pose on which more features agree than
    by chance is accepted. From then on three-point resection in samples gives the robot's pose from tracked features
    and from those that are matched with the target view again, whose tracks start again.

    With fewer than `MIN_INLIERS` the map is rebuilt from the matches of the same tick, with the old map's scale, or the
    target is lost. It is also rebuilt where many more matches agree, since more is matched from closer by. A map that
    says the target is reached, where the two views still differ, is discarded. Then the features that agreed with it
    make no map for `MAX_REFUTED_M`, as they may be of a thing that looks like one at the target. A place more than
    `MAX_JUMP_M` from where odometry leads is not believed.

    A relative pose with few inliers may be one of another place that looks the same. The map is `doubtful` until
    `MIN_VERIFIED_INLIERS` features agree in two images that were taken `MIN_BASELINE_M` from each other or more, and
    both give the target the same heading. Of doubtful maps the one with the most inliers is kept for a short way. A
    target that was confirmed needs one such image to be found again a short way on.

    Where far more matches agree with a pose of a camera that leans, in two images, the planar solver works upright.

    Without `tracks` only matches count; without `motion` (odometry) the robot's pose is not predicted, the unit in
    metres is not known, and any two images confirm each other, those of a stationary robot too: the camera is the
    only sensor. The map has the places of the `camera`, which may sit beside the robot's axis. Raises BadInput for
    correspondences of other features.
    """

    matching: Literal["every_image", "at_start"] = "every_image"
    """Whether features are matched with the target's again in every image, or, as in the paper, once, and then only
    tracked: until the target is lost, which is a new start."""

    solver: Solver = "planar"
    """Solver of the first relative pose; `eight_point` is the paper's. `planar` keeps the robot on the floor later
    too."""
    refine: bool = True
    """Whether poses that samples agree on are brought to their local optimum; the paper keeps the best sample's."""
    max_false_alarms: Annotated[float, Bounds(gt=0)] = 0.01
    """Expected number of wrong relative poses with which as many features agree by chance."""
    verify: bool = True
    """Requires a second image to confirm a new map, and the target's look an arrival; the paper requires neither."""

    class Out(Outputs):
        """Absent where there is no target; `tracks` are those of the tracker, with what the map knows of them."""

        map: LocalMap | None = None
        tracks: TrackedFeatures | None = None

    def step(
        self,
        ctx: Context,
        state: LocalMappingState,
        features: LocalFeatures,
        target: HomingTarget | None = None,
        correspondences: Correspondences | None = None,
        tracks: TrackedFeatures | None = None,
        motion: Motion | None = None,
        camera: Camera | None = None,
    ) -> Out:
        """Locate the camera; `correspondences` are of `features` with those of the target."""
        motion = camera_motion(motion, camera)
        if motion is not None:
            way = math.hypot(motion.x, motion.y)
            state.since = compose(state.since, (motion.x, motion.y, motion.turn))
            state.unseen_m, state.refuted_m = state.unseen_m + way, state.refuted_m + way
            state.witness = state.witness if state.unseen_m <= MAX_DOUBTFUL_M else None
            state.refuted = state.refuted if state.refuted_m <= MAX_REFUTED_M else NO_ROWS
        if target is None:
            state.map = None
            return self.Out()
        if target.number != state.target:
            state.target, state.doubtful, state.witness, state.refuted = target.number, None, None, NO_ROWS
        matches = matches_with(target, features, correspondences)
        before = state.map if state.map is not None and state.map.target == target.number else None
        arm = 0.0 if camera is None else math.hypot(*camera.arm[:2])
        if before is not None and motion is None and arm > MIN_ARM_M:
            ctx.warn(
                f"homing: the camera sits {arm:.2f} m beside the robot's axis, for which homing allows "
                "by odometry alone: without it the robot may circle around its target; type "
                "wires.local_map.motion=source.motion wires.tracker.motion=source.motion"
            )
        local_map = LocalMap(-1, target.number, "lost") if before is None else before.moved(motion)
        shown = self._tracked(ctx, state, local_map, tracks, matches)
        state.map = shown
        if motion is None:  # without odometry they would never be forgotten
            state.refuted = NO_ROWS
        if shown.state == "lost":
            state.map, shown = self._begun(ctx, state, shown, matches, motion)
        if shown.state in ("new", "tracking"):
            state.unseen_m = 0.0
        return self.Out(map=shown, tracks=_labelled(shown, tracks) if len(shown) else None)

    def _tracked(
        self,
        ctx: Context,
        state: LocalMappingState,
        local_map: LocalMap,
        tracks: TrackedFeatures | None,
        matches: Matches,
    ) -> LocalMap:
        """The map with the robot in it, or a better one; lost where it is not known."""
        if not len(local_map):
            return replace(local_map, why="")
        fresh = matches if self.matching == "every_image" else NO_MATCHES
        local_map = self._resection(ctx, local_map, tracks, fresh, levelling(state.vertical))
        if local_map.state != "tracking":
            return replace(local_map, why=f"{local_map.why}; ")
        # Closer to the target more is matched with it; at the target the baseline is too short.
        far = local_map.distance() > MIN_REBUILD_DISTANCE * local_map.depth()
        more = REBUILD_RATIO * local_map.first_inliers
        if far and len(fresh.rows) > more:
            new, _ = self._made(ctx, state, local_map, fresh, round(more))
            if new is not None:
                return new
        if not self._contradicted(local_map, matches if self.verify else fresh):
            return local_map
        ctx.count("false_map")
        state.witness = None
        if self.verify:
            agreed = local_map.rows[local_map.kinds != LOST]
            state.doubtful, state.refuted, state.refuted_m = None, np.union1d(state.refuted, agreed), 0.0
        return LocalMap(-1, local_map.target, "lost")

    def _begun(
        self, ctx: Context, state: LocalMappingState, lost: LocalMap, matches: Matches, motion: Motion | None
    ) -> tuple[LocalMap, LocalMap]:
        """The map to continue with, and the one to show: a new one is both; a doubtful one is shown for a short way."""
        new, reason = self._made(ctx, state, lost, matches, MIN_INLIERS)
        if new is not None and (not self.verify or self._verified(state, new, motion is not None)):
            state.doubtful = None
            return new, new
        lost = replace(lost, inliers=0, why=lost.why + reason, kinds=np.full(len(lost), LOST))
        known = None if state.doubtful is None or motion is None else state.doubtful.moved(motion)
        if known is not None and math.hypot(*known.odometry[:2]) > MAX_DOUBTFUL_M:
            known = None
        if new is not None:
            ctx.count("doubtful_map")
            why = f"{new.inliers} of {len(matches.rows)} matches with the target view agree, as another place might"
            if known is None or new.inliers >= known.inliers:  # wrong poses of fewer features point anywhere
                known = replace(new, state="doubtful", why=why)
        state.doubtful = known
        if known is None:
            ctx.count("lost_target")
            return lost, lost
        return lost, known

    def _resection(
        self, ctx: Context, local_map: LocalMap, tracks: TrackedFeatures | None, matches: Matches, level: Array
    ) -> LocalMap:
        kinds, points = np.full(len(local_map), LOST), np.full((len(local_map), 2), np.nan)
        tracked, bearings, places = np.zeros(0, np.int64), np.zeros((0, 3)), np.zeros((0, 3))
        if tracks is not None and tracks.number == local_map.number:
            kinds = tracks.kinds.copy()
            tracked = np.flatnonzero(kinds != LOST)
            bearings, places = tracks.bearings[tracked], tracks.places[tracked]
        # A matched feature is kept beside its track, at its own position.
        row_of = {int(row): n for n, row in enumerate(local_map.rows)}
        known = np.array([row_of.get(int(row), -1) for row in matches.rows], np.int64)
        matched = np.flatnonzero(known >= 0)
        owners = known[matched]
        bearings = np.concatenate([bearings, matches.first[matched]])
        places = np.concatenate([places, local_map.places[owners]])
        usable = np.isfinite(bearings).all(axis=1)
        threshold = math.radians(MAX_RESECTION_ERROR_DEG)
        resected = three_point_pose(
            bearings[usable] @ level.T,
            places[usable] @ level.T,
            ctx.rng,
            threshold,
            refine=self.refine,
            planar=self.solver == "planar",
        )
        resected = resected and seen_leaning(resected, level)
        agrees = np.zeros(len(bearings), np.bool_)
        if resected is not None:
            agrees[usable] = resected.inliers
        inliers = len(np.unique(np.append(tracked, owners)[agrees]))  # tracked and matched is one feature
        if resected is None or inliers < MIN_INLIERS:
            why = f"{inliers} tracked features agree on where the robot is, {MIN_INLIERS} are needed"
            return replace(local_map, state="lost", inliers=inliers, why=why)
        jump = math.dist(resected.translation, local_map.translation) * local_map.metres
        if jump > MAX_JUMP_M:
            why = f"the place on which {inliers} features agree is {jump:.1f} m from where odometry leads"
            return replace(local_map, state="lost", inliers=inliers, why=why)
        kinds[tracked[~agrees[: len(tracked)]]] = LOST
        started = agrees[len(tracked) :] & (kinds[owners] == LOST)
        kinds[owners[started]], points[owners[started]] = MATCHED, matches.points[matched[started]]
        moved, driven = math.hypot(*resected.translation[:2]), math.hypot(*local_map.odometry[:2])
        metres = driven / moved if moved > MIN_MAP_MOTION and driven > MIN_ODOMETRY_M else local_map.metres
        return replace(
            local_map,
            state="tracking",
            inliers=inliers,
            why="",
            kinds=kinds,
            points=points,
            rotation=resected.rotation,
            translation=resected.translation,
            metres=metres,
        )

    def _contradicted(self, local_map: LocalMap, matches: Matches) -> bool:
        # At the target a matched feature has the target view's bearing, but for the turn and what is left of the way.
        depth_ratio = local_map.distance() / max(local_map.depth(), 1e-9)
        if depth_ratio > ARRIVAL_DISTANCE or (not self.verify and local_map.inliers > len(matches.rows) / 3):
            return False
        turn = local_map.rotation.T @ local_map.goal_rotation
        turned = matches.second @ turn.T
        chord = 2.0 * math.sin(math.radians(MAX_OUTLIER_DEG) / 2.0 + depth_ratio)
        same = np.linalg.norm(turned - matches.first, axis=1) < chord
        enough = MIN_VERIFIED_INLIERS if self.verify else 0
        share = SAME_SHARE_AT_TARGET if self.verify and depth_ratio <= AT_TARGET else SAME_SHARE
        if np.count_nonzero(same) < max(share * len(matches.rows), enough):
            return True
        return self.verify and shown_sectors(matches.there @ turn.T, turned[same], matches.here) < SHOWN_SECTORS

    def _verified(self, state: LocalMappingState, new: LocalMap, with_odometry: bool) -> bool:
        # Whether this image and one before confirm each other; without odometry place and heading do not count.
        if new.inliers < MIN_VERIFIED_INLIERS:
            return False
        heading = yaw_of(new.goal_rotation)
        if state.witness is not None:
            off = abs(wrap_angle(state.since[2] + heading - state.witness))
            if not with_odometry or off < math.radians(MAX_HEADING_DIFFERENCE_DEG):
                return not with_odometry or math.hypot(*state.since[:2]) >= MIN_BASELINE_M
        state.witness, state.since, state.unseen_m = heading, np.zeros(3), 0.0
        return False

    def _made(
        self, ctx: Context, state: LocalMappingState, old: LocalMap, matches: Matches, min_inliers: int
    ) -> tuple[LocalMap | None, str]:
        """A map of two views, or None with the reason."""
        good = np.isfinite(matches.first).all(axis=1) & np.isfinite(matches.second).all(axis=1)
        good &= ~np.isin(matches.rows, state.refuted)
        first, points, second = matches.first[good], matches.points[good], matches.second[good]
        threshold = math.radians(MAX_EPIPOLAR_ERROR_DEG)
        found = self._pose(ctx, state, first, second, threshold)
        inliers = 0 if found is None else int(np.count_nonzero(found.inliers))
        agree = f"{inliers} of {len(first)} matches with the target view agree"
        if found is None or inliers < max(MIN_INLIERS, min_inliers):
            return None, f"{agree}, {MIN_INLIERS} are needed"
        if false_alarms(found, first, second, threshold, self.solver) > self.max_false_alarms:
            return None, f"{agree}, as they might by chance"
        places = triangulate(first, second, found.rotation, found.translation)
        wide = parallax(first, second, found.rotation) >= math.radians(MIN_PARALLAX_DEG)
        chosen = found.inliers & wide & np.isfinite(places).all(axis=1)
        if np.count_nonzero(chosen) < 3:  # the views are almost the same, and all features are far away
            chosen = found.inliers
            places = first / math.sin(math.radians(MIN_PARALLAX_DEG))
        unit, metres = 1.0, 0.0
        if len(old):
            scale = max(old.distance(), 1e-3)
            unit, metres = old.unit * scale, old.metres * scale
        state.made += 1
        new = LocalMap(
            number=state.made,
            target=old.target,
            state="new",
            inliers=inliers,
            rows=matches.rows[good][chosen],
            places=places[chosen],
            kinds=np.full(np.count_nonzero(chosen), MATCHED),
            points=points[chosen],
            goal_rotation=found.rotation,
            goal_translation=found.translation,
            first_inliers=inliers,
            unit=unit,
            metres=metres,
        )
        return new, ""

    def _pose(
        self, ctx: Context, state: LocalMappingState, first: Array, second: Array, threshold: float
    ) -> AgreedPose | None:
        # The pose of the target view, and what the matches show of the camera's vertical.
        level = levelling(state.vertical)
        found = relative_pose(first @ level.T, second @ level.T, ctx.rng, self.solver, threshold, refine=self.refine)
        if found is None:
            return None
        agree = int(np.count_nonzero(found.inliers))
        if self.solver == "planar" and agree < LEVEL_SHARE * len(first) and state.vertical[2] == 1.0:
            enough = max(MIN_VERIFIED_INLIERS, math.ceil(LEANING_GAIN * agree))
            state.level(ctx, vertical_of(first, second, ctx.rng, threshold, enough))
        return seen_leaning(found, level)


def shown_sectors(target: Array, same: Array, here: Array) -> float:
    """Share of the sectors around the robot in which a fifth of the target's features have the same bearings.

    All bearings (N, 3) are in the robot's frame. Sectors count in which both views have features, since a camera may
    not see all around. Features of one object agree on a place beside another like it, but only in one direction.
    """
    azimuths = (np.arctan2(bearings[:, 1], bearings[:, 0]) for bearings in (target, same, here))
    number, agreed, seen = (np.histogram(each, SECTORS, (-math.pi, math.pi))[0] for each in azimuths)
    compared = (number >= MIN_IN_SECTOR) & (seen > 0)
    return float((agreed >= SHOWN_OF_SECTOR * number)[compared].mean()) if compared.any() else 1.0


def matches_with(target: HomingTarget, features: LocalFeatures, pairs: Correspondences | None) -> Matches:
    """Matches of the present view in the target view. Raises BadInput where the pairs are of other features."""
    if pairs is None or not len(pairs):
        return NO_MATCHES
    here, there = features.point_bearings(), target.features.point_bearings()
    if pairs.first.max() >= len(here) or pairs.second.max() >= len(there):
        raise BadInput(
            "local_map: correspondences that are not those of the present features with the target's; match "
            "local_map's own features with those of its target"
        )
    pixels = features.point_pixels()[pairs.first]
    return Matches(here[pairs.first], pixels, there[pairs.second], pairs.second, here, there)


def _labelled(local_map: LocalMap, tracks: TrackedFeatures | None) -> TrackedFeatures:
    # The tracks with the kinds that the map gives them; matched features at their own pixels.
    if tracks is None or tracks.number != local_map.number:
        unknown = np.full((len(local_map), 3), np.nan)
        return TrackedFeatures(
            local_map.number, local_map.rows, local_map.kinds, local_map.points, unknown, local_map.places
        )
    shown = np.where((local_map.kinds == MATCHED)[:, None], local_map.points, tracks.points)
    return replace(tracks, kinds=local_map.kinds, points=shown)

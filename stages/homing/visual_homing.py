"""Back to where a picture was taken, by the features that are seen in both."""

import math
from dataclasses import field
from typing import Annotated, Literal

import numpy as np
import numpy.typing as npt

from omninav.pipeline import Bounds, Context, Outputs, Stage, State
from omninav.pipeline.graph.problems import BadInput
from omninav.stages.camera.models import Camera
from omninav.stages.geometry.plane.se2 import compose
from omninav.stages.geometry.two_views.absolute_pose import three_point_pose
from omninav.stages.geometry.two_views.epipolar import turn_about_vertical, yaw_of
from omninav.stages.geometry.two_views.relative_pose_ransac import Solver, false_alarms, relative_pose
from omninav.stages.geometry.two_views.triangulation import parallax, triangulate
from omninav.stages.values.correspondences import Correspondences
from omninav.stages.values.homing import HomingTarget, HomingVector, TrackedFeatures
from omninav.stages.values.image import Image, Panorama
from omninav.stages.values.local_features import LocalFeatures
from omninav.stages.values.pose import Motion

from .tracking import LEVELS, best_nearby, find_again, histograms, track, trackability
from .working_image import WorkingImage, working_picture

Array = npt.NDArray[np.float64]
Bools = npt.NDArray[np.bool_]
Floats = npt.NDArray[np.float32]
Ints = npt.NDArray[np.int64]
LOST, TRACKED, AGAIN, MATCHED = range(4)
"""Kinds of `TrackedFeatures`."""


def _rows(*shape: int) -> Array:
    return field(default_factory=lambda: np.zeros((0, *shape)))


class VisualHomingState(State):
    """The local map, where the robot and the target are in it, and what is being tracked.

    The map's frame is the robot's where it was made, its unit the way from there to the target. `anchors` (N, 3): the
    places of features that were matched with `rows` (N,) of the target's; `corners` (N, 3): of the trackable points
    beside them, which are at `points` (N, 2) of the `picture` before where `alive` (N,), and look like `looks` (N, 16).
    `rotation`, `translation`: the robot in the map; `goal_rotation`, `goal_translation`: where the target was taken.
    `unit`: the map's unit in units of the first baseline. `rolled`: odometry since the map was made (m, m, rad);
    `metres`: the map's unit by it, 0 where it is not known yet. `number`: whose map it is, -1 where there is none.
    `depth`: typical distance of the points from the robot. `made_of`: how many features agreed when the map was made.
    """

    number: int = -1
    mapped: bool = False
    rows: Ints = field(default_factory=lambda: np.zeros(0, np.int64))
    anchors: Array = _rows(3)
    corners: Array = _rows(3)
    points: Array = _rows(2)
    alive: Bools = field(default_factory=lambda: np.zeros(0, np.bool_))
    looks: npt.NDArray[np.float32] = field(default_factory=lambda: np.zeros((0, LEVELS), np.float32))
    picture: npt.NDArray[np.uint8] = field(default_factory=lambda: np.zeros((0, 0), np.uint8))
    rotation: Array = field(default_factory=lambda: np.eye(3))
    translation: Array = field(default_factory=lambda: np.zeros(3))
    goal_rotation: Array = field(default_factory=lambda: np.eye(3))
    goal_translation: Array = field(default_factory=lambda: np.zeros(3))
    rolled: Array = field(default_factory=lambda: np.zeros(3))
    made_of: int = 0
    unit: float = 1.0
    metres: float = 0.0
    depth: float = 0.0

    def left(self) -> float:
        """How far it is over the floor to the target, in the map's unit."""
        return math.hypot(*(self.goal_translation - self.translation)[:2])

    def expected(self, seen: WorkingImage, rows: Ints | slice = slice(None)) -> Array:
        """Where the tracked points of `rows` must be in a picture taken where the robot is: (N, 2)."""
        return seen.points((self.corners[rows] - self.translation) @ self.rotation)


class VisualHoming(Stage):
    """Where a target view was taken, seen from the robot: at first from two views, then by a local map while it drives.

    Goedemé et al. 2007, section 7. At a new target the bearings of features that are seen in both views give the
    relative pose (`solver`; `threshold_deg` is what two bearings may be off together), and the places of the features
    around the robot, in units of the way to the target. So many must agree that less than `chance` false poses are to
    be expected on which as many do (`geometry.consensus.false_alarms`). From then on the most trackable points beside
    them are tracked, lost ones are looked for where they must be, and the robot's pose among them follows from three
    at a time: a homing vector each tick. Features that are matched with the target view anew take part wherever they
    are in the map: tracks that have drifted away are noticed, and start again from there. Less than `least` features
    that agree are no basis: the map is made anew from the matches of that tick, its unit by what was known before, or
    the target is lost. It is also made anew where `anew` times as many matches agree as when it was made, since more
    is matched from closer by, unless the target is nearer than `too_near` of what is seen. A map that is wrong shows
    where it says that the target is reached: within `near` of what is seen the two views must be alike. Where most
    features that are matched are more than `stray_deg` off after the turn, and few of them agree with the map, it is
    thrown away.

    `motion` (odometry) is used if it is wired: to begin the search for tracked points, and for metres. `planar`: the
    robot is on a floor. Points with less parallax than `least_parallax_deg` have no known place. `window`, `levels`: of
    the tracker (pixels, halvings), which must come back within `agreed` pixels. `reach`, `alike`, `quality`: see
    `tracking.find_again`. `patch`: radius (pixels) of what histograms look at. Pictures of more than `largest` pixels
    are made smaller. Raises BadInput for a picture of which no bearings are known.
    """

    solver: Solver = "planar"
    planar: bool = True
    threshold_deg: Annotated[float, Bounds(gt=0)] = 1.0
    pose_threshold_deg: Annotated[float, Bounds(gt=0)] = 2.0
    least: Annotated[int, Bounds(ge=4)] = 6
    chance: Annotated[float, Bounds(gt=0)] = 0.01
    anew: Annotated[float, Bounds(ge=1)] = 1.5
    too_near: Annotated[float, Bounds(ge=0)] = 0.1
    near: Annotated[float, Bounds(ge=0)] = 0.05
    stray_deg: Annotated[float, Bounds(gt=0)] = 10.0
    least_parallax_deg: Annotated[float, Bounds(ge=0)] = 1.0
    anchor_reach: Annotated[int, Bounds(ge=0)] = 3
    window: Annotated[int, Bounds(ge=3)] = 15
    levels: Annotated[int, Bounds(ge=0)] = 3
    agreed: Annotated[float, Bounds(gt=0)] = 1.0
    reach: Annotated[float, Bounds(gt=0)] = 8.0
    patch: Annotated[int, Bounds(ge=1)] = 5
    alike: Annotated[float, Bounds(ge=0, le=1)] = 0.25
    quality: Annotated[float, Bounds(ge=0)] = 0.01
    largest: Annotated[int, Bounds(ge=1024)] = 76800

    class Out(Outputs):
        """Absent where there is no target."""

        vector: HomingVector | None = None
        tracks: TrackedFeatures | None = None

    def step(
        self,
        ctx: Context,
        memory: VisualHomingState,
        image: Image | Panorama,
        target: HomingTarget | None = None,
        features: LocalFeatures | None = None,
        correspondences: Correspondences | None = None,
        camera: Camera | None = None,
        motion: Motion | None = None,
    ) -> Out:
        """One homing vector. `correspondences`: of `features`, those of this picture, with those of the target."""
        if target is None:
            memory.number, memory.mapped = -1, False
            return self.Out()
        seen = working_picture(image, camera, self.largest)
        if target.number != memory.number:
            memory.number, memory.mapped, memory.unit = target.number, False, 1.0
        matched = self._matched(features, target, correspondences)
        why = "no features were matched with the target view"
        if memory.mapped:
            self._predict(memory, motion)
            kinds, points, inliers = self._follow(ctx, memory, seen, *matched)
            if inliers >= self.least and self._could_be_better(memory, len(matched[0])):
                more, _ = self._begin(ctx, memory, seen, *matched, at_least=round(self.anew * memory.made_of))
                if more:
                    return self._out(memory, seen, "new", more, np.full(len(memory.rows), TRACKED), memory.points)
            if inliers >= self.least and self._contradicted(memory, matched[0], matched[2], inliers):
                ctx.count("false_map")
                memory.mapped, memory.unit = False, 1.0
            elif inliers >= self.least:
                return self._out(memory, seen, "tracking", inliers, kinds, points)
            why = f"{inliers} tracked features agree on where the robot is, {self.least} are needed"
        made, said = self._begin(ctx, memory, seen, *matched)
        if made:
            kinds = np.full(len(memory.rows), TRACKED)
            return self._out(memory, seen, "new", made, kinds, memory.points)
        ctx.count("lost_target")
        why = f"{why}; {said}" if memory.mapped else said
        memory.picture = seen.grey
        memory.alive = np.zeros(len(memory.alive), np.bool_)
        return self.Out(vector=self._vector(memory, "lost", 0, why))

    def _matched(
        self, features: LocalFeatures | None, target: HomingTarget, pairs: Correspondences | None
    ) -> tuple[Array, Array, Array, Ints]:
        # Bearings and pixels now, bearings in the target view, and rows there.
        if features is None or pairs is None or not len(pairs):
            return np.zeros((0, 3)), np.zeros((0, 2)), np.zeros((0, 3)), np.zeros(0, np.int64)
        if pairs.first.max() >= len(features) or pairs.second.max() >= len(target.features):
            raise BadInput(
                "homing: correspondences that are not those of the present features with the target's; wire "
                "wires.match.first=features.features and wires.match.second to the features of homing's own target"
            )
        return (
            features.bearings[pairs.first],
            features.points[pairs.first],
            target.features.bearings[pairs.second],
            pairs.second,
        )

    def _could_be_better(self, memory: VisualHomingState, matches: int) -> bool:
        # Closer to the target more is matched with it; at the target the baseline is too short.
        return matches > self.anew * memory.made_of and memory.left() > self.too_near * memory.depth

    def _contradicted(self, memory: VisualHomingState, first: Array, second: Array, inliers: int) -> bool:
        # At the target what is matched with it stands where the target view has it, but for the turn.
        if memory.left() > self.near * memory.depth or inliers > len(first) / 3:
            return False
        turned = second @ (memory.rotation.T @ memory.goal_rotation).T
        off = np.linalg.norm(turned - first, axis=1)
        return bool(np.count_nonzero(off < 2.0 * math.sin(math.radians(self.stray_deg) / 2.0)) < len(first) / 2)

    def _begin(
        self,
        ctx: Context,
        memory: VisualHomingState,
        seen: WorkingImage,
        first: Array,
        pixels: Array,
        second: Array,
        rows: Ints,
        at_least: int = 0,
    ) -> tuple[int, str]:
        """Make a local map of two views; gives how many features agree, 0 with the reason where it cannot be made."""
        good = np.isfinite(first).all(axis=1) & np.isfinite(second).all(axis=1)
        first, pixels, second, rows = first[good], pixels[good], second[good], rows[good]
        found = relative_pose(first, second, ctx.rng, self.solver, math.radians(self.threshold_deg))
        inliers = 0 if found is None else int(np.count_nonzero(found.inliers))
        if found is None or inliers < max(self.least, at_least):
            return 0, f"{inliers} of {len(first)} matches with the target view agree, {self.least} are needed"
        if false_alarms(found, first, second, math.radians(self.threshold_deg)) > self.chance:
            return 0, f"{inliers} of {len(first)} matches with the target view agree, as they might by chance"
        places = triangulate(first, second, found.rotation, found.translation)
        wide = parallax(first, second, found.rotation) >= math.radians(self.least_parallax_deg)
        known = found.inliers & wide & np.isfinite(places).all(axis=1)
        if np.count_nonzero(known) >= 3:
            places, rays, points = places[known], first[known], seen.from_original(pixels[known])
            memory.rows, depths = rows[known], np.linalg.norm(places, axis=1)
        else:  # hardly any parallax: the views are alike, and whatever is seen is far away
            far = found.inliers
            depths = np.full(inliers, 1.0 / math.sin(math.radians(max(self.least_parallax_deg, 0.5))))
            places, rays, points = depths[:, None] * first[far], first[far], seen.from_original(pixels[far])
            memory.rows = rows[far]
        if memory.mapped:  # the new unit by the old map
            left = memory.rotation.T @ (memory.goal_translation - memory.translation)
            shrunk = max(float(np.hypot(left[0], left[1])), 1e-3)
            memory.unit, memory.metres = memory.unit * shrunk, memory.metres * shrunk
        else:
            memory.metres = 0.0
        strength = trackability(seen)
        corners = best_nearby(strength, seen, points, self.anchor_reach)
        beside = seen.bearings(corners)
        usable = np.isfinite(beside).all(axis=1) & seen.inside(corners, 2.0)
        corners, beside = np.where(usable[:, None], corners, points), np.where(usable[:, None], beside, rays)
        memory.anchors, memory.corners, memory.points = places, depths[:, None] * beside, corners
        memory.alive, memory.looks = np.ones(len(places), np.bool_), histograms(seen, corners, self.patch)
        memory.rotation, memory.translation = np.eye(3), np.zeros(3)
        memory.goal_rotation, memory.goal_translation = found.rotation, found.translation
        memory.rolled, memory.depth = np.zeros(3), float(np.median(depths))
        memory.picture, memory.mapped, memory.made_of = seen.grey, True, inliers
        return inliers, ""

    def _predict(self, memory: VisualHomingState, motion: Motion | None) -> None:
        # The robot's pose in the map as odometry has it; without one it stays.
        if motion is None:
            return
        memory.rolled = compose(memory.rolled, (motion.x, motion.y, motion.turn))
        if memory.metres > 0.0:
            step = np.array([motion.x, motion.y, 0.0]) / memory.metres
            memory.translation = memory.translation + memory.rotation @ step
        memory.rotation = memory.rotation @ turn_about_vertical(motion.turn)

    def _follow(
        self,
        ctx: Context,
        memory: VisualHomingState,
        seen: WorkingImage,
        first: Array,
        pixels: Array,
        second: Array,
        rows: Ints,
    ) -> tuple[Ints, Array, int]:
        """Track, find again, and place the robot in the local map; gives kinds, points, and how many agree."""
        kinds, points = np.full(len(memory.rows), LOST), np.full((len(memory.rows), 2), np.nan)
        expected = memory.expected(seen)
        if memory.picture.shape == seen.grey.shape:
            old = np.flatnonzero(memory.alive)
            guesses = np.where(np.isfinite(expected[old]), expected[old], memory.points[old])
            now, kept = track(memory.picture, seen, memory.points[old], guesses, self.window, self.levels, self.agreed)
            points[old[kept]], kinds[old[kept]] = now[kept], TRACKED
        # What is matched with the target view anew stands beside the tracks, at its own place.
        place = {int(row): n for n, row in enumerate(memory.rows)}
        anew = [(n, place[int(row)]) for n, row in enumerate(rows) if int(row) in place]
        matches, owners = np.array(anew, np.int64).reshape(-1, 2).T
        tracked = np.flatnonzero(kinds == TRACKED)
        rays = np.concatenate([seen.bearings(points[tracked]), first[matches]])
        places = np.concatenate([memory.corners[tracked], memory.anchors[owners]])
        usable = np.isfinite(rays).all(axis=1)
        limit = math.radians(self.pose_threshold_deg)
        found = three_point_pose(rays[usable], places[usable], ctx.rng, limit, planar=self.planar)
        memory.picture = seen.grey
        agrees = np.zeros(len(rays), np.bool_)
        if found is not None:
            agrees[usable] = found.inliers
        inliers = len(np.unique(np.append(tracked, owners)[agrees]))  # who is tracked and matched is one feature
        if found is None or inliers < self.least:
            memory.alive = np.zeros(len(memory.alive), np.bool_)
            return kinds, points, inliers
        memory.rotation, memory.translation = found.rotation, found.translation
        kinds[tracked[~agrees[: len(tracked)]]] = LOST
        self._learn_metres(memory)
        strength = trackability(seen)
        self._find_lost(memory, seen, strength, kinds, points)
        alive = (kinds == TRACKED) | (kinds == AGAIN)
        memory.points, memory.alive = np.where(alive[:, None], points, memory.points), alive
        fresh = agrees[len(tracked) :] & (kinds[owners] == LOST)
        kinds[owners[fresh]], points[owners[fresh]] = MATCHED, seen.from_original(pixels[matches[fresh]])
        self._start_again(memory, seen, strength, np.unique(owners[fresh]))
        steady = np.flatnonzero(memory.alive & (kinds != AGAIN))
        memory.looks[steady] = histograms(seen, memory.points[steady], self.patch)
        lost = np.flatnonzero(kinds == LOST)
        points[lost] = memory.expected(seen, lost)
        memory.depth = float(np.median(np.linalg.norm(memory.anchors - memory.translation, axis=1)))
        return kinds, points, inliers

    def _start_again(self, memory: VisualHomingState, seen: WorkingImage, strength: Floats, rows: Ints) -> None:
        """Features that were matched anew are tracked again: at the best point near to where theirs must be."""
        expected = memory.expected(seen, rows)
        inside = seen.inside(expected, 2.0)
        rows, expected = rows[inside], expected[inside]
        corners = best_nearby(strength, seen, expected, self.anchor_reach)
        rays = seen.bearings(corners)
        usable = np.isfinite(rays).all(axis=1) & seen.inside(corners, 2.0)
        rows, corners, rays = rows[usable], corners[usable], rays[usable]
        away = np.linalg.norm(memory.corners[rows] - memory.translation, axis=1)
        memory.corners[rows] = memory.translation + (away[:, None] * rays) @ memory.rotation.T
        memory.points[rows], memory.alive[rows] = corners, True

    def _find_lost(
        self, memory: VisualHomingState, seen: WorkingImage, strength: Floats, kinds: Ints, points: Array
    ) -> None:
        expected = memory.expected(seen)
        lost = np.flatnonzero((kinds == LOST) & seen.inside(expected, 2.0))
        if not len(lost):
            return
        again, who = find_again(
            seen,
            strength,
            expected[lost],
            memory.looks[lost],
            self.reach,
            self.patch,
            self.alike,
            self.quality,
        )
        points[lost[who]], kinds[lost[who]] = again[who], AGAIN

    def _learn_metres(self, memory: VisualHomingState) -> None:
        # Ways by odometry and in the map since it was made; a tenth of the unit is enough to compare them.
        rolled, went = math.hypot(*memory.rolled[:2]), math.hypot(*memory.translation[:2])
        if went > 0.1 and rolled > 0.05:
            memory.metres = rolled / went

    def _vector(
        self, memory: VisualHomingState, state: Literal["new", "tracking", "lost"], inliers: int, why: str = ""
    ) -> HomingVector:
        left = memory.rotation.T @ (memory.goal_translation - memory.translation)
        distance = float(np.hypot(left[0], left[1]))
        known = memory.mapped
        return HomingVector(
            number=memory.number,
            direction=math.atan2(left[1], left[0]) if known else 0.0,
            turn=yaw_of(memory.rotation.T @ memory.goal_rotation) if known else 0.0,
            distance=distance if known else 1.0,
            ratio=distance * memory.unit if known else 1.0,
            nearness=distance / memory.depth if known and memory.depth > 0.0 else 1.0,
            metres=distance * memory.metres if known and memory.metres > 0.0 else None,
            inliers=inliers,
            state=state,
            why=why,
        )

    def _out(
        self,
        memory: VisualHomingState,
        seen: WorkingImage,
        state: Literal["new", "tracking"],
        inliers: int,
        kinds: Ints,
        points: Array,
    ) -> Out:
        tracks = TrackedFeatures(seen.to_original(points), kinds, memory.rows)
        return self.Out(vector=self._vector(memory, state, inliers), tracks=tracks)

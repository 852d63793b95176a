"""The path to where an image was taken, along the references of a map."""

import math
from dataclasses import field
from typing import Annotated, Literal

import numpy as np

from omninav.pipeline import BadInput, Bounds, Context, Outputs, Stage, State, Tick
from omninav.stages.geometry.arrays import Array, Ints
from omninav.stages.geometry.landmarks.unbroken_view import of_one_place
from omninav.stages.geometry.plane.roadmap import Paths, ahead_on, path_from, paths_to
from omninav.stages.geometry.plane.se2 import wrap_angle
from omninav.stages.values.belief import PoseEstimate
from omninav.stages.values.commands import GOAL_TOPIC, GoalPoint
from omninav.stages.values.confidence import PoseConfidence
from omninav.stages.values.drive import pose_row
from omninav.stages.values.homing import DrivingStatus, HomingVector, PathProgress
from omninav.stages.values.landmarks import LandmarkFix
from omninav.stages.values.local_features import LocalFeatures
from omninav.stages.values.maps import ReferenceGraph
from omninav.stages.values.planned_route import PlannedRoute

MIN_PROBABILITY = 0.5
"""Least confidence in the estimate with which the robot drives, and probability of a pose that proves an arrival."""
MIN_GOAL_PROBABILITY, SURE_GOAL_PROBABILITY = 0.2, 0.95
"""Least probability of a pose of the goal's image that the robot drives to, and the one below which it compares images
there: of 168 goals in rooms' middles 21 have less than 0.9, 16 of them a right pose (docs/experiments/landmarks.md)."""
UNLIKE_IMAGES = 5
"""Images in a row that do not look like a doubtful goal's, at its place, after which it is given up: a person may be
in front of it."""
LOOKAHEAD_M = 0.8
"""Distance along the path of the point that the robot drives towards, metres."""
LEG_M = 2.0
"""Length of the legs of a path, metres: progress towards the goal is compared within one."""
ARRIVAL_M, MAX_HEADING_ERROR_DEG = 0.02, 2.0
"""Distance to the goal at which the robot has only to turn, metres, and heading error with which it has arrived."""
DETOUR_M, BLOCKED_RADIUS_M = 10.0, 0.8
"""Metres by which a path counts as longer that leads closer than the radius to where it was found blocked; ten times as
many where it was blocked twice."""
RETRY_S, BLOCKED_HERE = 5.0, 3
"""Seconds from a blocked path to the next one, and how often it may be blocked at one place."""
FAR_M = 5.0
"""Largest distance of a point to drive to from the references, metres: nothing is known beyond."""
NEAR_M, HOVER_S = 0.1, 10.0
"""Distance of the estimate from a point, metres, and seconds of it after which the robot has arrived, though no
landmarks show so."""
SEARCH_S = 120.0
"""Seconds for which the robot may not know where it is, and wander, before it gives up."""


class RoadmapPlannerState(State):
    """The goal and the path there.

    `goal` (3,): x, y (m), heading (rad; NaN: any); empty before the first tick. `rivals` (K, 3): where else its image
    may have been taken; `doubtful`: whether the look of the place has to confirm it. `metres`, `next` (R,): of the
    shortest path to it from each reference; `extra` (R,): metres that count more where paths were blocked, and
    `between` (B, 3): places x, y and such metres where they were, far from any; `retry`: from when on (ns) they can be
    again. `lost_since` (ns): since when the robot does not know where it is; None: it does. `number`: of the path, -1
    before the first, and the references along it, `places` (K,), as it was planned. `leg`: its number, and `left`:
    metres to go when it began, inf before it does. `arrival`: metres from the goal at which it docks; `unlike`: images
    in a row that did not look like it there. `near_since` (ns): since when the estimate keeps to a point; None: it does
    not. `asked`: goals before this one.
    """

    goal: Array = field(default_factory=lambda: np.zeros(0))
    rivals: Array = field(default_factory=lambda: np.zeros((0, 3)))
    doubtful: bool = False
    metres: Array = field(default_factory=lambda: np.zeros(0))
    next: Ints = field(default_factory=lambda: np.zeros(0, np.int64))
    extra: Array = field(default_factory=lambda: np.zeros(0))
    between: Array = field(default_factory=lambda: np.zeros((0, 3)))
    retry: int = 0
    lost_since: int | None = None
    number: int = -1
    places: Ints = field(default_factory=lambda: np.zeros(0, np.int64))
    leg: int = 0
    left: float = math.inf
    docking: bool = False
    arrival: float = ARRIVAL_M
    unlike: int = 0
    near_since: int | None = None
    asked: int = 0
    ended: Literal["", "arrived", "gave up"] = ""
    why: str = ""


class RoadmapPlanner(Stage):
    """Gives the vector along the shortest path to a goal over the references of a map, at every tick.

    The roadmap's points are the references, joined along the drive and wherever two are closer than the robot is wide,
    so that no wall is between them. The goal's pose is that of its image by landmarks. While the confidence in its own
    pose is high enough, the robot drives towards a point a short way ahead (pure pursuit); else it is lost, until
    landmarks locate it. It has arrived where landmarks in its present image show so. Where they are not sure of the
    goal, few are seen there: then its estimate counts too, and its image must show what the goal's does; else it
    continues to the other place that they name. Where a path is blocked, ways around are preferred; where none leads
    past that place, it gives up. Blocked within its own radius of the goal, it ends there. Raises BadInput for a goal
    that the map's landmarks cannot place.
    """

    goal: str | int | None = None
    """The goal's image file; `/goal_pose`: a `point` comes later."""
    robot_radius_m: Annotated[float, Bounds(gt=0)] = 0.25
    """The robot's body (m)."""

    class Out(Outputs):
        """`vector`: absent once the path has ended, and so is `progress`, but of a robot that has arrived."""

        vector: HomingVector | None = None
        progress: PathProgress | None = None
        route: PlannedRoute

    def step(
        self,
        ctx: Context,
        state: RoadmapPlannerState,
        tick: Tick,
        map: ReferenceGraph,
        estimate: PoseEstimate,
        confidence: PoseConfidence,
        fix: LandmarkFix | None = None,
        goal_fix: LandmarkFix | None = None,
        goal_features: LocalFeatures | None = None,
        features: LocalFeatures | None = None,
        status: DrivingStatus | None = None,
        point: GoalPoint | None = None,
    ) -> Out:
        """Give the vector to drive along; `status`: of the tick before, `point` a new goal of a robot that runs."""
        if tick.first_of_log:  # its clock may be behind that of the one before
            state.lost_since, state.near_since, state.retry = None, None, 0
        if point is not None:
            self._set_out(state, map, np.array([point.x, point.y, math.nan]))
            state.rivals, state.doubtful, state.asked = np.zeros((0, 3)), False, state.asked + 1
            off = float(np.hypot(*(map.poses[:, :2] - state.goal[:2]).T).min())
            if off > FAR_M:
                state.ended, state.why = "gave up", f"the goal is {off:.0f} m from the nearest place of the map"
        elif not len(state.goal) and self.goal == GOAL_TOPIC:
            return self.Out(route=_route(state, "locating"))
        elif not len(state.goal):
            poses, state.doubtful = goal_poses(self.goal, goal_fix, goal_features, map)
            self._set_out(state, map, poses[0])
            state.rivals = poses[1:]
        if state.ended:
            return _stopped(state)
        pose, sure = np.array(pose_row(estimate.pose)), confidence.probability >= MIN_PROBABILITY
        found = sure and state.lost_since is not None
        state.lost_since = None if sure else tick.stamp if state.lost_since is None else state.lost_since
        if state.lost_since is not None and tick.stamp - state.lost_since > SEARCH_S * 1e9:
            state.ended, state.why = "gave up", f"for {SEARCH_S:g} s it has not found out where it is"
            return _stopped(state)
        places = self._path(state, map, pose)
        new = sure and math.isinf(state.left)
        told = fix is not None and fix.probabilities[0] >= MIN_PROBABILITY
        at, known = fix.poses[0] if fix is not None and told else pose, told or (state.doubtful and sure)
        away = math.dist(at[:2], state.goal[:2])
        at_point = sure and math.isnan(state.goal[2]) and math.dist(pose[:2], state.goal[:2]) <= NEAR_M
        state.near_since = None if not at_point else tick.stamp if state.near_since is None else state.near_since
        if state.near_since is not None and tick.stamp - state.near_since >= HOVER_S * 1e9:
            state.ended = "arrived"
            return _stopped(state)
        if status is None or status.state != "blocked":
            state.arrival = state.arrival if state.docking else ARRIVAL_M
        elif tick.stamp >= state.retry:
            state.retry = tick.stamp + int(RETRY_S * 1e9)
            if known and away <= self.robot_radius_m:  # what is there today lets it no closer
                state.arrival = away + ARRIVAL_M
            elif places is not None:
                ctx.count("blocked_path")
                ahead, _ = ahead_on(_line(state, map, places), pose[:2], LOOKAHEAD_M)
                away_m = np.hypot(*(map.poses[:, :2] - ahead).T)
                more = np.maximum(DETOUR_M, 10.0 * state.extra)
                state.extra = np.where(away_m <= BLOCKED_RADIUS_M, more, state.extra)
                here_m = state.extra[away_m.argmin()]
                if away_m.min() > BLOCKED_RADIUS_M:
                    same = np.hypot(*(state.between[:, :2] - ahead).T) <= BLOCKED_RADIUS_M
                    here_m = max(DETOUR_M, 10.0 * state.between[same, 2].max(initial=0.0))
                    state.between = np.vstack([state.between[~same], [*ahead, here_m]])
                if here_m >= DETOUR_M * 10.0 ** (BLOCKED_HERE - 1):
                    state.ended, (x, y) = "gave up", ahead
                    state.why = f"its way near ({x:.1f}, {y:.1f}) m was blocked {BLOCKED_HERE} times: {status.why}"
                    return _stopped(state)
                self._plan(state, map)
                places, new = self._path(state, map, pose), True
        if places is None:
            state.ended, state.why = "gave up", "no path leads to the goal"
            return _stopped(state)
        if new:
            state.number, state.places = state.number + 1, places
        ahead, beyond = ahead_on(_line(state, map, places), pose[:2], LOOKAHEAD_M)
        x, y = ahead - pose[:2]
        remaining_m = math.hypot(x, y) + beyond
        carried = found and remaining_m > state.left + LEG_M  # to where what it drove before says nothing
        if new or carried or remaining_m + LEG_M < state.left < math.inf:
            state.leg, state.left = state.leg + 1, remaining_m
        turn = 0.0 if math.isnan(state.goal[2]) else wrap_angle(state.goal[2] - at[2])
        if known:
            state.docking = away <= state.arrival + (ARRIVAL_M if state.docking else 0.0)
        if state.docking and abs(turn) <= math.radians(MAX_HEADING_ERROR_DEG):
            self._judge(ctx, state, map, goal_features, features, turn)
            if not state.docking:  # it sets out for the rival
                return self.Out(route=_route(state, "under way"))
        if state.ended:
            return _stopped(state)
        begun = state.left < math.inf
        vector = HomingVector(
            number=state.leg,
            direction=wrap_angle(math.atan2(y, x) - pose[2]),
            turn=turn,
            distance=remaining_m,
            ratio=1.0 - (state.left - remaining_m) / max(min(state.left, LEG_M), 1e-3) if begun else 1.0,
            depth_ratio=1.0,
            metres=math.hypot(x, y) if begun and sure else None,
            inliers=0 if fix is None else int(fix.inliers[0]),
            state="tracking" if sure else "lost",
            why="" if sure else f"the confidence in where it is is {confidence.probability:.2f}",
        )
        progress = PathProgress(state.number, 0, 1, state.leg, beyond == 0.0, state.docking, False)
        return self.Out(vector=vector, progress=progress, route=_route(state, "under way" if sure else "locating"))

    def _set_out(self, state: RoadmapPlannerState, map: ReferenceGraph, goal: Array) -> None:
        state.goal, state.extra, state.places = goal, np.zeros(len(map)), np.zeros(0, np.int64)
        state.between = np.zeros((0, 3))
        state.docking, state.ended, state.why, state.left = False, "", "", math.inf
        state.lost_since, state.near_since, state.arrival, state.unlike = None, None, ARRIVAL_M, 0
        self._plan(state, map)

    def _plan(self, state: RoadmapPlannerState, map: ReferenceGraph) -> None:
        reach = 2.0 * self.robot_radius_m
        goal, points, extra = state.goal[:2], map.poses[:, :2], (state.extra, state.between)
        state.metres, state.next = paths_to(goal, points, map.edges, reach, *extra)

    def _path(self, state: RoadmapPlannerState, map: ReferenceGraph, here: Array) -> Ints | None:
        to_goal = math.dist(here[:2], state.goal[:2])
        known = Paths(state.metres, state.next)
        return path_from(here[:2], map.poses[:, :2], known, 2.0 * self.robot_radius_m, to_goal)

    def _judge(
        self,
        ctx: Context,
        state: RoadmapPlannerState,
        map: ReferenceGraph,
        goal: LocalFeatures | None,
        features: LocalFeatures | None,
        turn: float,
    ) -> None:
        """End at a goal that is not doubtful or looks as its image does; else set out for the next, or give up."""
        if not state.doubtful:
            state.ended = "arrived"
            return
        if goal is None or features is None:
            return
        if of_one_place((goal.bearings, goal.descriptors), (features.bearings, features.descriptors), -turn):
            state.ended = "arrived"
            return
        state.unlike += 1
        if state.unlike < UNLIKE_IMAGES:
            return
        ctx.count("looks_different")
        if len(state.rivals):
            goal_pose, state.rivals = state.rivals[0], state.rivals[1:]
            self._set_out(state, map, goal_pose)
        else:
            state.ended = "gave up"
            reached = ", from as close as what is there allows" if state.arrival > ARRIVAL_M else ""
            hint = "give an image from closer to the mapped way"
            state.why = f"where landmarks put {self.goal} it looks different{reached}; {hint}"


def _line(state: RoadmapPlannerState, map: ReferenceGraph, places: Ints) -> Array:
    """The path (K, 2) over references to the goal."""
    return np.vstack([map.poses[places, :2], state.goal[:2]])


def _route(state: RoadmapPlannerState, now: Literal["locating", "under way", "arrived", "gave up"]) -> PlannedRoute:
    why = state.why if now == "gave up" else ""
    goal = GoalPoint(*state.goal[:2].tolist()) if len(state.goal) else None
    return PlannedRoute(state.places, now, state.number, why, goal, state.asked)


def _stopped(state: RoadmapPlannerState) -> RoadmapPlanner.Out:
    if state.ended != "arrived":
        return RoadmapPlanner.Out(route=_route(state, "gave up"))
    there = PathProgress(state.number, 1, 1, state.leg, True, False, True)
    return RoadmapPlanner.Out(progress=there, route=_route(state, "arrived"))


def goal_poses(
    goal: str | int | None, fix: LandmarkFix | None, features: LocalFeatures | None, map: ReferenceGraph
) -> tuple[Array, bool]:
    """The poses (K, 3) from which the goal's image may have been taken, the likeliest first; and whether it is doubtful
    that the first is right. Raises BadInput where landmarks give none."""
    if map.landmarks is None:
        raise BadInput("goal: the map was saved without landmarks; learn it again from its tour with landmarks=sift")
    if fix is not None and fix.probabilities[0] >= MIN_GOAL_PROBABILITY:
        likely = fix.probabilities >= MIN_GOAL_PROBABILITY
        return fix.poses[likely], bool(fix.probabilities[0] < SURE_GOAL_PROBABILITY)
    seen = 0 if features is None else len(features)
    agree = "too few landmarks agree on where it was taken"
    if fix is not None:
        agree = f"{fix.inliers[0]} landmarks agree on where it was taken, which are too few or on one side of it"
        if len(fix) > 1:
            agree += f"; {fix.inliers[1]} on another place"
    raise BadInput(
        f"goal: the map's landmarks do not tell where {goal} was taken: it shows {seen} features, and {agree}; "
        "give an image from closer to where the map was made, or the map of that place"
    )

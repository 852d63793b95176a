"""Driving to an image's place in a room of landmarks."""

import math
import re
from dataclasses import replace

import numpy as np
import pytest
from landmark_tour import graph_of, mapped_room, room, seen_from, tour_poses

from omninav.pipeline import Context, Tick
from omninav.pipeline.graph.problems import BadInput
from omninav.stages.control.follow_homing import FollowHoming, FollowHomingState
from omninav.stages.geometry.plane.se2 import compose
from omninav.stages.planning.roadmap import (
    BLOCKED_HERE,
    HOVER_S,
    RoadmapPlanner,
    RoadmapPlannerState,
    goal_poses,
)
from omninav.stages.sensor.landmark_pose import LandmarkPose, LandmarkPoseState
from omninav.stages.values.belief import PoseEstimate
from omninav.stages.values.commands import GOAL_TOPIC, GoalPoint
from omninav.stages.values.confidence import PoseConfidence
from omninav.stages.values.homing import DrivingStatus, HomingVector, PathProgress
from omninav.stages.values.landmarks import LandmarkFix
from omninav.stages.values.local_features import LocalFeatures
from omninav.stages.values.pose import Pose

START, GOAL = (2.0, 2.6, 2.0), (8.0, 3.2, -1.0)
BLOCKED = DrivingStatus("blocked", "a chair")


def fix_of(features: LocalFeatures) -> LandmarkFix | None:
    stage, ctx = LandmarkPose(), Context("landmark_pose")
    stage.setup(ctx)
    return stage.step(ctx, LandmarkPoseState(), features, mapped_room()).fix


def fix_at(pose) -> LandmarkFix:
    found = fix_of(seen_from(room(), np.array(pose)))
    assert found is not None
    return found


class Drive:
    """A robot that knows its pose, and obeys."""

    def __init__(self, start=START, goal_features=None) -> None:
        self.planner, self.plan = RoadmapPlanner(goal="shelf.png"), RoadmapPlannerState()
        self.follow, self.following = FollowHoming(), FollowHomingState()
        self.pose, self.tick, self.status = np.array(start), 0, None
        self.features = seen_from(room(), np.array(GOAL)) if goal_features is None else goal_features
        self.goal = fix_of(self.features)

    def step(self, confidence=1.0, fix=None, point=None, status=None, sees=True) -> RoadmapPlanner.Out:
        tick, ctx = Tick(self.tick, 10**15 + self.tick * 200_000_000), Context("planning")
        self.tick += 1
        pose = Pose(*self.pose.tolist())
        estimate, seen = PoseEstimate(pose, np.eye(3), 1.0, pose), seen_from(room(), self.pose) if sees else None
        own = mapped_room(), estimate, PoseConfidence(confidence)
        out = self.planner.step(
            ctx, self.plan, tick, *own, fix, self.goal, self.features, seen, status or self.status, point
        )
        done = self.follow.step(ctx, self.following, tick, out.vector, out.progress)
        self.status = done.status
        turned = compose(self.pose, (done.command.speed * 0.2, 0.0, done.command.turning * 0.2))
        self.pose = np.array(turned)
        return out


def test_a_robot_stops_where_the_image_was_taken_and_looks_as_it_did() -> None:
    drive = Drive()
    out = drive.step()
    assert out.vector.direction == pytest.approx(0.0 - START[2], abs=0.35)  # along the way that was mapped
    while out.route.state != "arrived" and drive.tick < 400:
        near = math.dist(drive.pose[:2], GOAL[:2]) < 1.0
        out = drive.step(fix=fix_at(drive.pose) if near else None)
    assert math.dist(drive.pose[:2], GOAL[:2]) < 0.03
    assert abs(drive.pose[2] - GOAL[2]) < math.radians(3.0)
    assert drive.tick < 200
    assert out.route.number == 0
    assert drive.status.state == "arrived"


def test_a_robot_without_a_goal_waits_until_it_is_sent() -> None:
    drive = Drive()
    drive.planner, drive.goal, drive.features = RoadmapPlanner(goal=GOAL_TOPIC), None, None
    waiting = [drive.step() for _ in range(3)]
    assert [(out.vector, out.route.state, out.route.goal) for out in waiting] == [(None, "locating", None)] * 3
    assert (drive.pose == START).all()
    assert drive.step(point=GoalPoint(*GOAL[:2])).route.state == "under way"
    assert drive.step().vector is not None


def test_only_landmarks_tell_that_it_has_arrived() -> None:
    drive = Drive(start=GOAL)
    assert not drive.step().progress.docking
    assert drive.step(fix=fix_at(GOAL)).route.state == "arrived"


def test_a_robot_that_keeps_to_a_point_without_landmarks_has_arrived() -> None:
    drive, point = Drive(start=GOAL), GoalPoint(GOAL[0] + 0.05, GOAL[1])
    drive.step(point=point)
    states = []
    while drive.tick < 60:
        drive.pose = np.array(GOAL)  # its way there is finer than its wheels
        states.append(drive.step().route.state)
    assert states.index("arrived") == round(HOVER_S / 0.2) - 1
    assert "arrived" not in [Drive(start=WRONG).step(point=point).route.state for _ in range(60)]


def test_a_point_far_from_the_map_is_no_goal() -> None:
    drive = Drive()
    out = drive.step(point=GoalPoint(5000.0, 2.0))
    assert out.route.state == "gave up"
    assert re.fullmatch(r"the goal is 49\d\d m from the nearest place of the map", out.route.why)
    assert drive.step(point=GoalPoint(*GOAL[:2])).route.state == "under way"


WRONG = (7.0, 3.2, -1.0)


def doubtful(drive: Drive, *poses, probabilities=(0.5, 0.3)) -> None:
    """Makes the goal one on whose place few landmarks agree."""
    drive.goal = replace(
        drive.goal,
        poses=np.array(poses),
        covariances=np.repeat(drive.goal.covariances[:1], len(poses), axis=0),
        inliers=np.full(len(poses), 12),
        probabilities=np.array(probabilities)[: len(poses)],
        agree=None,
    )


def looked(drive: Drive, **how) -> RoadmapPlanner.Out:
    """Stands where it is for as many images as it takes to judge a place."""
    return [drive.step(**how) for _ in range(5)][-1]


def test_a_doubtful_goal_is_borne_out_by_its_look_else_the_robot_goes_to_the_rival() -> None:
    drive = Drive(start=WRONG)
    doubtful(drive, WRONG, GOAL)
    assert looked(drive, sees=False).route.goal.x == WRONG[0]  # no image says nothing
    out = looked(drive)
    assert (out.vector, out.route.state, out.route.goal.x) == (None, "under way", GOAL[0])
    while out.route.state != "arrived" and drive.tick < 100:
        out = drive.step()  # at a doubtful goal its own estimate tells too
    assert math.dist(drive.pose[:2], GOAL[:2]) < 0.03
    assert (out.route.state, out.route.asked) == ("arrived", 0)


@pytest.mark.parametrize(("poses", "probabilities"), [([WRONG], [0.3]), ([WRONG, GOAL], [0.94, 0.19])])
def test_where_no_likely_place_looks_like_a_doubtful_goal_the_robot_says_so(poses, probabilities) -> None:
    drive = Drive(start=WRONG)
    doubtful(drive, *poses, probabilities=probabilities)
    route = looked(drive).route
    assert route.state == "gave up"
    assert "where landmarks put shelf.png it looks different; give an image" in route.why


def test_a_robot_that_judges_a_place_from_before_it_says_so() -> None:
    before = np.array((WRONG[0] - 0.2, WRONG[1], WRONG[2]))
    drive = Drive(start=before)
    doubtful(drive, WRONG)
    for _ in range(6):
        drive.pose = before
        out = drive.step(status=BLOCKED)
    assert out.route.state == "gave up"
    assert "it looks different, from as close as what is there allows; give an image" in out.route.why


def test_a_robot_that_is_not_sure_where_it_is_judges_no_place() -> None:
    drive = Drive(start=WRONG)
    doubtful(drive, WRONG)
    assert looked(drive, confidence=0.3).route.state == "locating"
    drive.step(point=GoalPoint(7.0, 3.2))
    assert drive.step(fix=fix_at(WRONG)).route.state == "arrived"  # of a point there is no image


def test_a_robot_that_does_not_know_where_it_is_has_no_route() -> None:
    drive = Drive()
    out = drive.step(confidence=0.3)
    assert (out.vector.state, out.vector.metres, out.route.state) == ("lost", None, "locating")
    assert drive.status.state == "lost"
    assert drive.step(confidence=0.9).route.state == "under way"
    for _ in range(5 * 121):
        out = drive.step(confidence=0.3)
    assert (out.route.state, out.route.why) == ("gave up", "for 120 s it has not found out where it is")


def test_a_robot_that_gets_lost_stops_at_once() -> None:
    drive = Drive()
    for _ in range(20):
        drive.step()
    before = drive.pose
    assert drive.step(confidence=0.3).vector.metres is None
    assert drive.status.state == "lost"
    assert drive.pose.tolist() == before.tolist()


def test_where_the_way_is_blocked_another_is_preferred() -> None:
    drive = Drive(start=(3.0, 3.0, 0.0))  # between two passes of the tour
    before = set(drive.step().route.places.tolist())
    after = drive.step(status=BLOCKED).route
    assert after.number == 1
    assert not before & set(after.places.tolist())


def test_where_no_other_way_leads_past_a_blocked_place_it_gives_up_there() -> None:
    drive = Drive(start=(GOAL[0] - 0.4, GOAL[1], GOAL[2]))
    numbers = [drive.step().route.number]
    for _ in range(26 * BLOCKED_HERE):
        drive.pose = np.array((GOAL[0] - 0.4, GOAL[1], GOAL[2]))
        out = drive.step(status=BLOCKED)
        numbers.append(out.route.number)
    assert out.route.state == "gave up"
    assert out.route.why == f"its way near ({GOAL[0]:.1f}, {GOAL[1]:.1f}) m was blocked {BLOCKED_HERE} times: a chair"
    assert (max(numbers), numbers.index(1), numbers.index(2)) == (2, 1, 26)  # five seconds from one to the next
    assert drive.status.state == "waiting"


def test_where_something_stands_at_the_goal_the_robot_turns_and_ends_before_it() -> None:
    before = np.array((GOAL[0] - 0.2, GOAL[1], GOAL[2] + 1.0))
    drive = Drive(start=before)
    for _ in range(3):
        out = drive.step(fix=fix_at(before))
        assert (out.route.state, out.progress.docking) == ("under way", False)
        drive.pose = before
    assert drive.step(fix=fix_at(before), status=BLOCKED).progress.docking
    while out.route.state != "arrived" and drive.tick < 100:
        out = drive.step(fix=fix_at(drive.pose))
    assert math.dist(drive.pose[:2], GOAL[:2]) == pytest.approx(0.2, abs=0.01)
    assert abs(drive.pose[2] - GOAL[2]) < math.radians(3.0)
    assert out.route.number == 0


def test_farther_from_the_goal_a_blocked_robot_looks_for_a_way_around() -> None:
    drive = Drive(start=(GOAL[0] - 0.4, GOAL[1], GOAL[2]))
    drive.step()
    assert drive.step(fix=fix_at(drive.pose), status=BLOCKED).route.number == 1


def test_a_robot_that_is_sent_elsewhere_goes_there_and_to_no_heading() -> None:
    drive = Drive(start=GOAL)
    drive.step(fix=fix_at(GOAL))
    out = drive.step(point=GoalPoint(2.0, 2.5))
    assert out.route.state == "under way"
    assert (out.route.goal.x, out.route.number, out.route.asked, out.vector.turn) == (2.0, 1, 1, 0.0)
    lost = drive.step(point=GoalPoint(3.0, 2.5), confidence=0.1)
    assert (lost.route.state, lost.route.places.tolist()) == ("locating", [])


def test_an_image_of_elsewhere_is_refused_with_what_was_seen() -> None:
    elsewhere = seen_from(room(seed=5), np.array(GOAL))
    drive = Drive(goal_features=elsewhere)
    with pytest.raises(BadInput, match=rf"where shelf.png was taken: it shows {len(elsewhere)} features, and .* agree"):
        drive.step()
    found = fix_at(GOAL)
    few = replace(
        found,
        poses=np.array([GOAL, WRONG, START]),
        covariances=np.repeat(found.covariances[:1], 3, axis=0),
        inliers=np.array([7, 5, 4]),
        probabilities=np.array([0.15, 0.1, 0.1]),
        agree=None,
    )
    with pytest.raises(BadInput, match=rf"it shows {len(elsewhere)} features, and 7 landmarks .*; 5 on another place;"):
        goal_poses("shelf.png", few, elsewhere, mapped_room())
    alone = few.without(np.array([False, True, True]))
    with pytest.raises(BadInput, match=r"it shows 0 features, and 7 landmarks .* on one side of it; give an image"):
        goal_poses("shelf.png", alone, None, mapped_room())
    for probabilities, poses, is_doubtful in (([0.95, 0.0, 0.05], 1, False), ([0.75, 0.2, 0.05], 2, True)):
        likely = goal_poses("", replace(few, probabilities=np.array(probabilities)), None, mapped_room())
        assert (likely[0].tolist(), likely[1]) == ([list(GOAL), list(WRONG)][:poses], is_doubtful)
    with pytest.raises(BadInput, match="without landmarks; learn it again"):
        goal_poses("shelf.png", None, None, graph_of(tour_poses()))


def test_it_docks_within_two_centimetres_until_it_is_four_away_and_arrives_within_two_degrees() -> None:
    drive, seen = Drive(start=GOAL), fix_at(GOAL)
    drive.step()

    def at(metres: float, degrees: float) -> RoadmapPlanner.Out:
        off = np.array([[metres, 0.0, math.radians(degrees)]])
        return drive.step(fix=replace(seen, poses=drive.plan.goal + off))

    unsure = replace(seen, poses=drive.plan.goal[None], probabilities=np.array([0.49]))
    assert not drive.step(fix=unsure).progress.docking
    docking = [at(metres, -2.2).progress.docking for metres in (0.022, 0.018, 0.038, 0.042, 0.03)]
    assert docking == [False, True, True, False, False]
    assert at(0.01, -2.2).vector.turn == pytest.approx(math.radians(2.2))
    assert at(0.01, 1.8).route.state == "arrived"


class Line:
    """A robot on a straight mapped way of 6 m that is asked to go to a point, with a heading of 0.3 rad."""

    def __init__(self, x: float) -> None:
        self.plan, self.point = RoadmapPlannerState(), GoalPoint(x, 0.0)
        self.map = graph_of(np.column_stack([np.arange(0.0, 6.5, 0.5), np.zeros((13, 2))]))

    def at(
        self, x: float, seconds: float = 0.0, confidence: float = 0.5, y: float = 0.0, first: bool = False, **how
    ) -> RoadmapPlanner.Out:
        pose, point, self.point = Pose(x, y, 0.3), self.point, None
        known = PoseEstimate(pose, np.eye(3), 1.0, pose), PoseConfidence(confidence)
        tick = Tick(0, int(seconds * 1e9), first_of_log=first)
        return RoadmapPlanner().step(Context("planning"), self.plan, tick, self.map, *known, point=point, **how)


def test_it_drives_to_a_point_ahead_and_its_ratio_falls_from_one_within_each_leg() -> None:
    line = Line(6.0)
    vectors = [line.at(x).vector for x in (0.0, 1.0, 1.9, 2.1, 5.5, 5.6)]
    assert [(v.direction, v.metres, v.distance) for v in vectors[:2]] == [
        pytest.approx((-0.3, 0.8, 6.0)), pytest.approx((-0.3, 0.8, 5.0))
    ]  # fmt: skip
    assert [v.number for v in vectors] == [1, 1, 1, 2, 3, 3]
    assert [v.ratio for v in vectors] == pytest.approx([1.0, 0.5, 0.05, 1.0, 1.0, 0.8])
    assert [line.at(x).progress.last for x in (4.5, 5.5)] == [False, True]
    assert vars(line.at(5.5).progress) == vars(PathProgress(0, 0, 1, 3, True, False, False))
    lost, why = line.at(5.5, confidence=0.49).vector, "the confidence in where it is is 0.49"
    expected = HomingVector(3, pytest.approx(-0.3), 0.0, 0.5, 1.0, 1.0, None, 0, "lost", why)
    assert vars(lost) == vars(expected)
    assert vectors[0].why == ""
    assert Line(6.0).at(0.2, y=0.2).route.places[0] == 1  # at 0.36 m, and the next at 0.82: the nearest is at 0.28


def test_a_leg_is_done_beyond_two_metres_and_none_begins_before_the_robot_knows_where_it_is() -> None:
    line = Line(6.0)
    lost = line.at(0.0, confidence=0.3).vector
    assert (lost.number, lost.ratio, lost.metres, lost.distance) == (0, 1.0, None, pytest.approx(6.0))
    vectors = [line.at(x).vector for x in (0.0, 2.0, 2.001)]
    assert [(v.number, v.ratio) for v in vectors] == [(1, 1.0), (1, pytest.approx(0.0)), (2, 1.0)]
    for confidence, number in ((0.9, 2), (0.3, 3)):  # found again farther back, it may have been carried
        vectors = [line.at(x, confidence=sure).vector for x, sure in ((2.1, 0.9), (0.0, confidence), (0.0, 0.9))]
        assert vectors[-1].number == number
    assert vectors[-1].ratio == 1.0


def test_where_the_map_falls_apart_no_path_leads_to_the_goal() -> None:
    line = Line(6.0)
    line.map = graph_of(np.column_stack([np.arange(7.0), np.zeros((7, 2))]))
    line.map = replace(line.map, edges=np.delete(line.map.edges, 3, axis=0))
    route = line.at(0.0).route
    assert (route.state, route.why) == ("gave up", "no path leads to the goal")


def test_it_goes_to_points_within_five_metres_of_the_map_and_has_arrived_after_ten_seconds_within_a_decimetre() -> None:
    assert [Line(x).at(0.0).route.state for x in (10.9, 11.1)] == ["under way", "gave up"]
    line = Line(6.0)
    outs = [line.at(x, s) for x, s in ((5.91, 0), (5.89, 5), (5.91, 9), (5.91, 18.9), (5.91, 19))]
    assert [out.route.state for out in outs] == ["under way"] * 4 + ["arrived"]
    assert vars(outs[-1].progress) == vars(PathProgress(0, 1, 1, 1, True, False, True))


def test_times_of_a_log_are_no_times_of_the_next_one() -> None:
    line = Line(6.0)
    line.at(1.0, seconds=1e6, status=BLOCKED)
    assert line.plan.extra.max() == 10.0
    line.at(1.0, first=True, status=BLOCKED)  # the clock was set back: it does not wait until it is as late again
    assert line.plan.extra.max() == 100.0
    line.at(1.0, seconds=10.0, confidence=0.4)
    assert line.at(1.0, seconds=1e6, confidence=0.4, first=True).route.state == "locating"
    line.point = GoalPoint(6.0, 0.0)
    line.at(5.95, seconds=1e6 + 1.0)
    assert line.at(5.95, seconds=2e6, first=True).route.state != "arrived"


def test_a_way_counts_longer_beside_where_it_was_blocked_and_ten_times_as_much_the_second_time() -> None:
    line = Line(6.0)
    for seconds, metres in ((0, 10.0), (4.9, 10.0), (5, 100.0)):
        line.at(0.1, seconds, status=BLOCKED)  # at 1.3 m: from the reference at 0.5 m on
        assert line.plan.extra[:6].tolist() == [0.0, *4 * [metres], 0.0]


def test_blocked_far_from_references_it_takes_another_way_and_gives_up_where_there_is_none() -> None:
    line = Line(6.0)
    line.point = GoalPoint(6.0, 3.0)
    routes = [line.at(6.0, seconds, y=0.6, status=BLOCKED).route for seconds in (0, 5, 10)]
    assert [route.state for route in routes] == ["under way", "under way", "gave up"]
    assert routes[2].why == "its way near (6.0, 1.4) m was blocked 3 times: a chair"
    line = Line(7.5)
    places = np.array([[0.0, 0, 0], [2.5, 0, 0], [5.0, 0, 0], [7.5, 0, 0], [2.5, 3, 0], [5.0, 3, 0]])
    line.map = replace(graph_of(places), edges=np.array([[0, 1], [1, 2], [2, 3], [1, 4], [4, 5], [5, 2]]))
    assert line.at(2.9).route.places.tolist() == [1, 2, 3]
    assert line.at(2.9, status=BLOCKED).route.places.tolist() == [1, 4, 5, 2, 3]

"""Homing in the built-in world: tracker, local map and vector against the poses that images were taken from."""

import functools
import math
from dataclasses import replace

import cv2
import numpy as np
import pytest
from turned_robot import CAMERA, both_kinds, look, wrapped

from omninav.pipeline import Context
from omninav.pipeline.engine.codec import decode, encode, encode_state, restore_state
from omninav.pipeline.graph.problems import BadInput
from omninav.stages.camera.donut import Donut
from omninav.stages.features.rotation_reduced_sift import RotationReducedSift
from omninav.stages.geometry.appearance.feature_matching import mutual_nearest
from omninav.stages.geometry.plane.mount import robot_poses
from omninav.stages.geometry.plane.se2 import between
from omninav.stages.geometry.two_views.epipolar import turn_about_vertical
from omninav.stages.geometry.two_views.relative_pose_ransac import Solver
from omninav.stages.homing.feature_tracker import MAX_PIXELS, FeatureTracker, FeatureTrackerState
from omninav.stages.homing.homing_vector import HomingVectorFromMap
from omninav.stages.homing.image_tracking import histograms
from omninav.stages.homing.local_mapping import (
    MAX_OUTLIER_DEG,
    MIN_VERIFIED_INLIERS,
    LocalMapping,
    LocalMappingState,
    Matches,
    matches_with,
    shown_sectors,
)
from omninav.stages.homing.vertical import levelling
from omninav.stages.homing.working_image import working_image
from omninav.stages.values.correspondences import Correspondences
from omninav.stages.values.homing import (
    FOUND_AGAIN,
    LOST,
    MATCHED,
    TRACKED,
    HomingTarget,
    HomingVector,
    LocalMap,
    TrackedFeatures,
)
from omninav.stages.values.image import Image, Panorama
from omninav.stages.values.local_features import LocalFeatures
from omninav.stages.values.pose import Motion

TARGET = (5.0, 5.0, 0.4)
UP = np.array([0.06, -0.03, math.sqrt(1.0 - 0.06**2 - 0.03**2)])
"""The vertical in the frame of a camera that leans by 4 degrees."""


@functools.cache
def described(kind: str, pose: tuple[float, float, float]) -> LocalFeatures:
    stage, context = RotationReducedSift(), Context("features")
    stage.setup(context)
    return stage.step(context, image=look(kind, pose[2], *pose[:2]), camera=CAMERA).features


def matched(features: LocalFeatures, other: LocalFeatures) -> Correspondences:
    one, two = features.descriptors.astype(np.float32), other.descriptors.astype(np.float32)
    squares = (one**2).sum(axis=1)[:, None] + (two**2).sum(axis=1)[None] - 2.0 * one @ two.T
    return Correspondences(*mutual_nearest(squares.astype(np.float32), 0.85)[:3])


class Homing:
    """The three stages of homing, wired as in the variants; one image suffices for a map, unless `verify`."""

    camera = CAMERA

    def __init__(self, kind: str = "mirror", seed: int = 0, verify: bool = False, **parameters) -> None:
        self.kind, self.ctx = kind, Context("local_map", np.random.default_rng(seed))
        self.tracker, self.tracked = FeatureTracker(), FeatureTrackerState()
        self.mapping, self.mapped = LocalMapping(verify=verify, **parameters), LocalMappingState()
        self.map: LocalMap | None = None
        self.target = HomingTarget(3, described(kind, TARGET))

    def at(self, pose, motion=None, matches=True, image: Image | Panorama | None = None, share=1.0) -> HomingVector:
        features = described(self.kind, pose)
        pairs = None
        if matches:
            pairs = matched(features, self.target.features)
            kept = slice(0, round(share * len(pairs)))
            pairs = Correspondences(pairs.first[kept], pairs.second[kept], pairs.distance[kept])
        image = look(self.kind, pose[2], *pose[:2]) if image is None else image
        tracks = self.tracker.step(self.ctx, self.tracked, image, self.camera, self.map, motion).tracks
        out = self.mapping.step(self.ctx, self.mapped, features, self.target, pairs, tracks, motion, self.camera)
        self.map, self.tracks = out.map, out.tracks
        vector = HomingVectorFromMap().step(self.ctx, out.map, self.camera).vector
        assert vector is not None
        return vector


def off_deg(vector: HomingVector, pose) -> tuple[float, float]:
    way = between(pose, TARGET)
    direction = wrapped(vector.direction - math.atan2(way[1], way[0]))
    return abs(math.degrees(direction)), abs(math.degrees(wrapped(vector.turn - way[2])))


def astray(vector: HomingVector, pose, start: float) -> float:
    """How far (m) from where the target is the vector ends, `start` (m) being the way to it at first."""
    way, said = between(pose, TARGET), vector.ratio * start
    return math.dist((said * math.cos(vector.direction), said * math.sin(vector.direction)), way[:2])


def drive(steps: int, start=(4.0, 4.2, -0.5), end=(4.8, 4.84, 0.3)) -> list[tuple[float, float, float]]:
    return [tuple(float(v) for v in row) for row in np.linspace(start, end, steps)]


@both_kinds
@pytest.mark.parametrize("pose", [(4.2, 4.6, 0.4), (5.9, 5.2, 2.0), (5.0, 4.1, -2.5), (4.6, 5.8, 0.0)])
def test_the_first_vector_points_to_where_the_target_was_taken(kind: str, pose) -> None:
    vector = Homing(kind).at(pose)
    assert vector.state == "new"
    direction, turn = off_deg(vector, pose)
    assert direction < 3.0
    assert turn < 1.0
    assert vector.distance == pytest.approx(1.0)
    assert vector.ratio == pytest.approx(1.0)
    assert vector.metres is None


@both_kinds
def test_on_the_way_the_vector_follows_the_local_map_without_any_match(kind: str) -> None:
    poses, homing = drive(9), Homing(kind)
    start = math.dist(poses[0][:2], TARGET[:2])
    for k, pose in enumerate(poses):
        vector = homing.at(pose, matches=k == 0)
        assert vector.state == ("tracking" if k else "new")
        assert off_deg(vector, pose)[1] < 2.0
        assert astray(vector, pose, start) < 0.1


def test_matched_at_the_start_alone_it_goes_on_by_tracks() -> None:
    once, never = Homing(matching="at_start"), Homing()
    poses = drive(9)
    for step, pose in enumerate(poses):
        told = once.at(pose)
        assert told.state == ("new" if step == 0 else "tracking")
        other = never.at(pose, matches=step == 0)
        assert (told.direction, told.distance, told.inliers) == (other.direction, other.distance, other.inliers)
        assert astray(told, pose, math.dist(poses[0][:2], TARGET[:2])) < 0.1


def test_poses_of_samples_are_worse_than_refined_ones() -> None:
    off = {refine: [] for refine in (True, False)}
    for refine, found in off.items():
        for seed in range(5):
            pose = (4.2, 4.6, 0.4)
            found.append(off_deg(Homing(seed=seed, refine=refine).at(pose), pose)[0])
    assert np.mean(off[False]) > np.mean(off[True])


def test_odometry_tells_metres() -> None:
    poses, homing = drive(9), Homing()
    for before, pose in zip([None, *poses], poses, strict=False):
        motion = None if before is None else Motion(*(float(v) for v in between(before, pose)))
        vector = homing.at(pose, motion)
    assert vector.metres == pytest.approx(math.dist(poses[-1][:2], TARGET[:2]), abs=0.08)


@pytest.mark.parametrize(("metres", "state"), [(0.15, "tracking"), (0.25, "new")])
def test_a_place_far_from_where_odometry_leads_is_not_believed(metres: float, state: str) -> None:
    homing, poses = Homing(), drive(7)
    on_the_way(homing, poses[:5])
    elsewhere = homing.map.translation + np.array([metres / homing.map.metres, 0.0, 0.0])
    homing.map = homing.mapped.map = replace(homing.map, translation=elsewhere)
    assert on_the_way(homing, poses[5:6], before=poses[4]) == [state]


def test_under_a_camera_in_front_of_its_axis_the_vector_is_the_robots() -> None:
    homing = Homing()
    homing.camera = replace(CAMERA, position_x=0.3, position_y=0.1)
    arm, poses = homing.camera.arm, drive(6, end=(4.6, 4.68, -0.3))
    robot, target = robot_poses(np.array(poses), arm), robot_poses(np.array(TARGET), arm)
    vector = homing.at(poses[0])
    for n in range(1, 6):
        vector = homing.at(poses[n], Motion(*between(robot[n - 1], robot[n]).tolist()))
    x, y, turn = between(robot[-1], target).tolist()
    assert vector.metres == pytest.approx(math.hypot(x, y), abs=0.05)
    assert wrapped(vector.direction - math.atan2(y, x)) == pytest.approx(0.0, abs=0.1)
    assert vector.turn == pytest.approx(turn, abs=0.03)
    beside = between(np.array(poses[-1]), np.array(TARGET))
    assert abs(wrapped(math.atan2(beside[1], beside[0]) - math.atan2(y, x))) > 0.2
    assert not homing.ctx.warnings
    homing.at(poses[-1])
    assert homing.ctx.warnings[0].startswith("homing: the camera sits 0.32 m beside the robot's axis")


def test_the_depth_ratio_tells_a_view_that_hardly_differs_from_the_first_tick_on() -> None:
    assert Homing().at((5.02, 5.01, 1.4)).depth_ratio < 0.04
    assert Homing().at((4.0, 4.2, 1.4)).depth_ratio > 0.1


def test_a_map_that_says_the_target_is_reached_where_views_differ_is_discarded() -> None:
    homing, pose = Homing(), (4.0, 4.2, -0.5)
    homing.at(pose)
    few = slice(0, 8)  # a false map is one on which few agree by chance
    wrong = homing.map
    homing.map = homing.mapped.map = replace(
        wrong,
        rows=wrong.rows[few],
        places=wrong.places[few],
        kinds=wrong.kinds[few],
        goal_translation=np.full(3, 0.01 * wrong.depth()),
    )
    vector = homing.at(pose)
    assert homing.ctx.counts["false_map"] == 1
    assert (vector.state, vector.ratio) == ("new", pytest.approx(1.0))
    assert off_deg(vector, pose)[0] < 3.0


STILL = Motion(0.0, 0.0, 0.0)
SIDE_BY_SIDE = (4.2, 4.6, 0.4), (4.3, 4.65, 0.4), (4.4, 4.7, 0.4)
"""Two steps of 0.11 m towards the target."""


def on_the_way(homing: Homing, poses, before=None) -> list[str]:
    """States of the vectors at these poses, with the motions from each to the next."""
    states = []
    for pose in poses:
        motion = STILL if before is None else Motion(*(float(v) for v in between(before, pose)))
        states.append(homing.at(pose, motion).state)
        before = pose
    return states


def test_a_new_map_is_doubtful_until_an_image_from_further_on_bears_it_out() -> None:
    assert on_the_way(Homing(verify=True), (*SIDE_BY_SIDE, (4.5, 4.75, 0.4))) == ["doubtful"] * 2 + ["new", "tracking"]


def test_images_of_a_robot_that_stands_do_not_bear_each_other_out() -> None:
    homing = Homing(verify=True)
    assert on_the_way(homing, SIDE_BY_SIDE[:1] * 6) == ["doubtful"] * 6
    assert on_the_way(homing, SIDE_BY_SIDE[2:], before=SIDE_BY_SIDE[0]) == ["new"]


def test_an_image_bears_out_none_from_long_after() -> None:
    homing = Homing(verify=True)
    homing.at(SIDE_BY_SIDE[0], STILL)
    for way in (0.35, -0.35):  # and back
        homing.at(SIDE_BY_SIDE[0], Motion(way, 0.0, 0.0), matches=False)
    assert on_the_way(homing, SIDE_BY_SIDE[2:], before=SIDE_BY_SIDE[0]) == ["doubtful"]


def test_a_target_that_was_borne_out_is_found_again_by_one_image_a_short_way_on() -> None:
    homing, poses = Homing(verify=True), [*SIDE_BY_SIDE, *drive(5, SIDE_BY_SIDE[2], (4.8, 4.85, 0.4))[1:]]
    on_the_way(homing, poses)
    for lost_for, state in ((0.0, "new"), (0.7, "doubtful")):
        homing.map = homing.mapped.map = None
        for way in (lost_for / 2, -lost_for / 2):
            homing.at(poses[-1], Motion(way, 0.0, 0.0), matches=False)
        assert homing.at(poses[-1], STILL).state == state


def test_too_few_matches_never_bear_each_other_out() -> None:
    homing = Homing(verify=True)
    for _ in range(4):
        vector = homing.at((4.2, 4.6, 0.4), share=0.25)
        assert (vector.state, 6 <= vector.inliers < MIN_VERIFIED_INLIERS) == ("doubtful", True)
    assert vector.why.endswith("matches with the target view agree, as another place might")


def test_two_images_with_different_headings_of_the_target_do_not_bear_each_other_out() -> None:
    homing, pose = Homing(verify=True), (4.2, 4.6, 0.4)
    homing.at(pose, STILL)
    x, y, _ = (float(v) for v in between(pose, SIDE_BY_SIDE[2]))
    assert homing.at(SIDE_BY_SIDE[2], Motion(x, y, math.radians(20.0))).state == "doubtful"  # it has not turned
    assert on_the_way(homing, [(4.6, 4.8, 0.4)], before=SIDE_BY_SIDE[2]) == ["new"]


def test_another_target_has_to_be_borne_out_anew() -> None:
    homing, pose = Homing(verify=True), (4.2, 4.6, 0.4)
    assert [homing.at(pose).state for _ in range(2)] == ["doubtful", "new"]
    homing.target = replace(homing.target, number=4)
    assert homing.at(pose).state == "doubtful"


def test_a_doubtful_target_is_remembered_for_a_short_way() -> None:
    homing, pose = Homing(verify=True), (4.2, 4.6, 0.4)
    homing.at(pose)
    vector = homing.at(pose, Motion(0.5, 0.0, 0.3), matches=False)
    assert vector.state == "doubtful"
    assert vector.direction == pytest.approx(homing.at(pose, Motion(0.0, 0.0, 0.0), matches=False).direction)
    assert off_deg(vector, pose)[0] == pytest.approx(math.degrees(0.3), abs=3.0)  # turned with the robot
    assert homing.at(pose, Motion(0.2, 0.0, 0.0), matches=False).state == "lost"


def test_a_doubtful_target_is_that_of_the_most_features_until_it_is_forgotten() -> None:
    homing, pose = Homing(verify=True), (4.2, 4.6, 0.4)
    most = homing.at(pose, STILL)
    assert homing.at(pose, STILL, share=0.25).direction == most.direction  # of fewer features, and elsewhere
    homing.at(pose, Motion(0.7, 0.0, 0.0), matches=False)
    assert homing.at(pose, STILL, share=0.25).inliers < most.inliers


@pytest.mark.parametrize("verify", [True, False])
def test_an_arrival_where_the_target_looks_different_is_not_believed(verify: bool) -> None:
    homing, pose = Homing(verify=verify), (4.0, 4.2, -0.5)
    while homing.at(pose).state == "doubtful":
        pass
    homing.map = homing.mapped.map = replace(homing.map, goal_translation=np.full(3, 0.01 * homing.map.depth()))
    assert (homing.at(pose).state, homing.ctx.counts["false_map"]) == (("doubtful", 1) if verify else ("tracking", 0))


@pytest.mark.parametrize("odometry", [True, False])
def test_features_that_led_to_another_place_make_no_map_for_three_metres(odometry: bool) -> None:
    homing, pose = Homing(verify=True), SIDE_BY_SIDE[-1]
    assert on_the_way(homing, (*SIDE_BY_SIDE, pose))[-1] == "tracking"
    homing.map = homing.mapped.map = replace(homing.map, goal_translation=np.full(3, 0.01 * homing.map.depth()))
    ways = (0.0, 2.9, 0.2) if odometry else (None, None, None)
    states = [homing.at(pose, None if way is None else Motion(way, 0.0, 0.0)).state for way in ways]
    assert (states, homing.ctx.counts["false_map"]) == (
        ["lost", "lost", "doubtful"] if odometry else ["doubtful", "new", "tracking"],
        1,
    )


@pytest.mark.parametrize(("pose", "believed"), [((4.97, 4.98, -0.5), True), ((4.7, 4.72, -0.5), False)])
def test_an_arrival_four_decimetres_away_is_not_believed(pose: tuple[float, float, float], believed: bool) -> None:
    homing = Homing(verify=True)
    while homing.at(pose).state != "tracking":
        pass
    homing.map = homing.mapped.map = replace(homing.map, goal_translation=homing.map.translation + 0.001)
    homing.at(pose)
    assert (homing.ctx.counts["false_map"] == 0) == believed


@pytest.mark.parametrize(("share", "depth_ratio", "believed"), [(65, 0.01, False), (75, 0.01, True), (65, 0.04, True)])
def test_at_the_target_seven_of_ten_matches_have_its_bearings(share: int, depth_ratio: float, believed: bool) -> None:
    homing, rng = Homing(verify=True), np.random.default_rng(0)
    while homing.at((4.97, 4.98, -0.5)).state != "tracking":
        pass
    ahead = np.array([depth_ratio * homing.map.depth(), 0.0, 0.0])
    near = replace(homing.map, goal_translation=homing.map.translation + ahead)
    seen_there = rng.normal(size=(100, 3))
    seen_there /= np.linalg.norm(seen_there, axis=1)[:, None]
    seen_here = seen_there @ (near.rotation.T @ near.goal_rotation).T
    seen_here[share:] *= -1.0
    matches = Matches(seen_here, np.zeros((100, 2)), seen_there, np.arange(100), seen_here, seen_there)
    assert homing.mapping._contradicted(near, matches) is not believed
    left = np.flatnonzero(seen_here[:share, 1] > 0)  # all agree, in one half of the directions
    of_one_side = Matches(seen_here[left], np.zeros((len(left), 2)), seen_there[left], left, seen_here, seen_there)
    assert homing.mapping._contradicted(near, of_one_side)


@pytest.mark.parametrize(("beyond", "inliers", "contradicted"), [(0.98, 6, False), (1.02, 33, True), (1.02, 34, False)])
def test_near_the_target_bearings_may_be_off_by_twice_what_is_left_of_the_way_unless_a_third_agrees(
    beyond: float, inliers: int, contradicted: bool
) -> None:
    rng = np.random.default_rng(0)
    there, aside = (each / np.linalg.norm(each, axis=1)[:, None] for each in rng.normal(size=(2, 100, 3)))
    axis = np.cross(there, aside)
    axis /= np.linalg.norm(axis, axis=1)[:, None]
    off = beyond * (math.radians(MAX_OUTLIER_DEG) + 2.0 * 0.02)
    turned = math.cos(off) * there + math.sin(off) * np.cross(axis, there)
    here, goal = turn_about_vertical(0.5), turn_about_vertical(0.8)
    map = LocalMap(
        1, 3, "tracking", inliers, rows=np.arange(100), places=5.0 * there, kinds=np.full(100, TRACKED),
        rotation=here, goal_rotation=goal, goal_translation=np.array([0.06, 0.08, 0.0]),
    )  # fmt: skip
    first = turned @ (here.T @ goal).T
    matches = Matches(first, np.zeros((100, 2)), there, np.arange(100), first, there)
    assert LocalMapping(verify=False)._contradicted(map, matches) is contradicted


@pytest.mark.parametrize(
    ("turned", "way", "heading", "odometry", "verified"),
    [
        (0.3, 0.3, 0.2, True, True),  # the target's heading was 0.5 before the robot turned by 0.3
        (0.3, 0.3, 0.2 + math.radians(4.9), True, True),
        (0.3, 0.3, 0.2 - math.radians(5.1), True, False),
        (-0.3, 0.3, 0.2, True, False),
        (0.3, 0.19, 0.2, True, False),  # from the same place
        (-0.3, 0.1, 0.2, False, True),  # without odometry neither counts
    ],
)
def test_two_images_agree_on_the_heading_of_the_target(
    turned: float, way: float, heading: float, odometry: bool, verified: bool
) -> None:
    state = LocalMappingState(witness=0.5, since=np.array([0.6 * way, -0.8 * way, turned]))
    new = LocalMap(1, 3, "new", MIN_VERIFIED_INLIERS, goal_rotation=turn_about_vertical(heading))
    agreed = abs(turned + heading - 0.5) < math.radians(5.0)
    assert LocalMapping()._verified(state, new, odometry) is verified
    assert state.witness == pytest.approx(0.5 if agreed or not odometry else heading)
    assert LocalMapping()._verified(state, replace(new, inliers=MIN_VERIFIED_INLIERS - 1), odometry) is False


def test_the_robot_is_where_tracks_and_matches_agree_and_each_feature_says_how_it_was_seen() -> None:
    rng = np.random.default_rng(0)
    places = rng.uniform(-4.0, 4.0, (30, 3))
    turn, at = turn_about_vertical(0.35), np.array([0.55, -0.15, 0.0])
    rays = (places - at) @ turn
    rays /= np.linalg.norm(rays, axis=1)[:, None]
    kinds = np.array([TRACKED] * 15 + [FOUND_AGAIN] * 3 + [LOST] * 12)
    kinds[1] = LOST
    bearings = np.where((kinds != LOST)[:, None], rays, np.nan)
    bearings[3] = -bearings[3]
    rows, pixels = np.arange(10, 40), np.arange(60.0).reshape(30, 2)
    tracks = TrackedFeatures(2, rows, kinds, pixels, bearings, places)
    seen = np.array([5, 20, 21, 22, 1])  # the last one is of another of the target's features
    first = np.where(seen[:, None] == 22, -rays[seen], rays[seen])
    matches = Matches(first, 100.0 + pixels[seen], first, np.array([15, 30, 31, 32, 99]), first, first)
    before = LocalMap(
        2, 3, "tracking", rows=rows, places=places, kinds=kinds, points=np.full((30, 2), np.nan),
        rotation=turn_about_vertical(0.3), translation=at - [0.05, 0.05, 0.0], metres=2.0,
        odometry=np.array([0.6, 0.8, 0.0]),
    )  # fmt: skip
    mapping = LocalMapping()

    def found(map: LocalMap = before, tracks: TrackedFeatures | None = tracks) -> LocalMap:
        return mapping._resection(Context("local_map", np.random.default_rng(0)), map, tracks, matches, np.eye(3))

    map = found()
    assert (map.state, map.inliers, map.why) == ("tracking", 16 + 2, "")
    assert map.translation == pytest.approx(at, abs=1e-6)
    assert map.rotation == pytest.approx(turn, abs=1e-6)
    expected = kinds.copy()
    expected[[3, 20, 21]] = LOST, MATCHED, MATCHED
    assert map.kinds.tolist() == expected.tolist()
    assert map.points[[20, 21]].tolist() == (100.0 + pixels[[20, 21]]).tolist()
    assert np.isnan(np.delete(map.points, [20, 21], axis=0)).all()
    assert map.metres == pytest.approx(1.0 / math.hypot(*at[:2]))
    assert found(replace(before, odometry=np.zeros(3))).metres == 2.0
    far = found(replace(before, metres=3.0))
    assert (far.state, far.why) == (
        "lost", "the place on which 18 features agree is 0.2 m from where odometry leads"
    )  # fmt: skip
    for gone in (None, replace(tracks, number=1)):
        assert found(tracks=gone).why.endswith("tracked features agree on where the robot is, 6 are needed")


def test_the_target_is_seen_in_a_direction_by_a_fifth_of_its_features() -> None:
    azimuths = np.deg2rad(np.arange(0.0, 360.0, 2.0))
    around = np.column_stack([np.cos(azimuths), np.sin(azimuths), np.zeros(180)])
    assert shown_sectors(around, around[::4], around) == 1.0  # 45 of 180 features, in all sectors of 30 degrees
    assert shown_sectors(around, around[::8], around) == 0.0
    assert shown_sectors(around, around[:90], around) == 0.5
    assert shown_sectors(around, around[:90], around[:90]) == 1.0  # where the camera sees
    assert shown_sectors(around[:3], around[:0], around) == 1.0  # three features tell nothing


def covered(pose) -> Image:
    """The view from a pose with a third of all azimuths hidden."""
    pixels = look("mirror", pose[2], *pose[:2]).pixels.copy()
    cv2.ellipse(pixels, (320, 240), (240, 240), 0, 0, 120, (90, 90, 90), -1)
    return Image(pixels)


def test_covered_features_are_found_again() -> None:
    homing, poses = Homing(), drive(13)
    for k, pose in enumerate(poses[:3]):
        homing.at(pose, matches=k == 0)
    homing.at(poses[3], matches=False, image=covered(poses[3]))
    lost = homing.tracks.kinds == 0
    assert lost.mean() > 0.2
    for pose in poses[4:6]:
        vector = homing.at(pose, matches=False)
    assert np.count_nonzero(homing.tracks.kinds[lost] == 2) >= 0.4 * np.count_nonzero(lost)
    assert off_deg(vector, poses[5])[0] < 6.0
    kinds, points = homing.tracks.kinds, homing.tracks.points
    assert np.isfinite(points[(kinds == 1) | (kinds == 2)]).all()


def test_tracks_tell_where_lost_features_should_be_and_which_of_the_targets_they_are() -> None:
    homing, poses = Homing(), drive(13)
    for k, pose in enumerate(poses[:3]):
        homing.at(pose, matches=k == 0)
    before = homing.tracks
    homing.at(poses[3], matches=False, image=covered(poses[3]))
    tracks = homing.tracks
    assert tracks.rows.tolist() == before.rows.tolist() == homing.map.rows.tolist()
    gone = (tracks.kinds == 0) & (before.kinds == 1)
    moved = np.hypot(*(tracks.points - before.points)[gone].T)
    assert gone.sum() >= 5
    assert np.nanmedian(moved) < 25.0  # pixels: a step of the drive away from where it was seen last


def test_a_tracked_feature_is_known_by_how_it_looked_last() -> None:
    # "each time a feature is successfully tracked, this histogram is updated" (section 7.2.2)
    homing, poses = Homing(), drive(13)
    for k, pose in enumerate(poses[:4]):
        homing.at(pose, matches=k == 0)
    last = homing.tracked.points.copy(), homing.tracked.alive.copy()
    seen = working_image(look("mirror", poses[3][2], *poses[3][:2]), CAMERA, MAX_PIXELS)
    homing.at(poses[4], matches=False)
    still = last[1] & (homing.tracks.kinds == 1)
    assert still.sum() >= 15
    looks = histograms(seen, last[0][still])
    np.testing.assert_array_equal(homing.tracked.histograms[still], looks)


def test_a_map_is_made_anew_where_more_is_matched(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("omninav.stages.homing.local_mapping.MIN_REBUILD_DISTANCE", 0.02)
    homing = Homing()
    homing.at((4.0, 4.2, -0.5), share=0.4)
    few, ratio = homing.map.first_inliers, []
    for pose in drive(4)[1:]:
        ratio.append(homing.at(pose).ratio)
    assert homing.map.first_inliers > few
    assert ratio[-1] == pytest.approx(
        math.dist(drive(4)[-1][:2], TARGET[:2]) / math.dist((4.0, 4.2), TARGET[:2]), abs=0.1
    )


def test_a_lost_target_says_why() -> None:
    homing = Homing()
    vector = homing.at((4.2, 4.6, 0.4), matches=False)
    assert (vector.state, vector.inliers) == ("lost", 0)
    assert vector.why == "0 of 0 matches with the target view agree, 6 are needed"
    assert homing.ctx.counts["lost_target"] == 1
    homing.at((4.2, 4.6, 0.4))
    blank = Image(np.full_like(look("mirror", 0.4).pixels, 80))
    vector = homing.at((4.2, 4.6, 0.4), matches=False, image=blank)
    assert vector.state == "lost"
    assert vector.why.startswith("0 tracked features agree on where the robot is, 6 are needed; 0 of 0 matches")
    assert off_deg(vector, (4.2, 4.6, 0.4))[0] < 3.0  # what was known last
    assert homing.at((4.2, 4.6, 0.4)).state == "tracking"  # as soon as it is matched again


def test_seven_matches_prove_the_pose_of_two_points_and_not_that_of_five() -> None:
    pose = (4.2, 4.6, 0.4)
    share = 7 / len(matched(described("mirror", pose), described("mirror", TARGET)))
    assert Homing(solver="planar").at(pose, share=share).state == "new"
    refused = Homing(solver="five_point").at(pose, share=share)
    assert (refused.state, refused.why) == (
        "lost",
        "7 of 7 matches with the target view agree, as they might by chance",
    )


def test_the_memory_of_a_killed_run_goes_on_to_the_same_vectors() -> None:
    poses, homing, other = drive(6), Homing(), Homing()
    for pose in poses[:3]:
        homing.at(pose)
    for one, two in ((homing.tracked, other.tracked), (homing.mapped, other.mapped)):
        restore_state(two, decode(encode(encode_state(one))))
    other.map = decode(encode(homing.map))
    other.ctx.rng.bit_generator.state = homing.ctx.rng.bit_generator.state
    for pose in poses[3:]:
        one, two = homing.at(pose), other.at(pose)
        assert (one.direction, one.turn, one.ratio, one.inliers) == (two.direction, two.turn, two.ratio, two.inliers)


def test_without_a_target_there_is_no_map_and_no_vector() -> None:
    homing, features = Homing(), described("mirror", (4.2, 4.6, 0.4))
    homing.at((4.2, 4.6, 0.4))
    out = homing.mapping.step(homing.ctx, homing.mapped, features, None)
    assert out.map is None
    assert homing.mapped.map is None
    assert HomingVectorFromMap().step(homing.ctx, None).vector is None
    assert homing.tracker.step(homing.ctx, homing.tracked, look("mirror", 0.4), CAMERA).tracks is None


def test_a_vector_is_in_the_robots_frame_and_its_lengths_are_in_their_units() -> None:
    # The robot at (1, 0) has turned by 90 degrees to the left, the target at (-3, 3) by 120: it is 3 ahead and 4 left.
    here, turned = np.array([1.0, 0.0, 0.0]), [turn_about_vertical(math.radians(angle)) for angle in (90.0, 120.0)]
    map = LocalMap(
        7, 3, "tracking", 20, rows=np.arange(3), places=here + 10.0 * np.eye(3), rotation=turned[0], translation=here,
        goal_rotation=turned[1], goal_translation=np.array([-3.0, 3.0, 0.0]), unit=0.04, metres=0.3,
    )  # fmt: skip
    at_robot = replace(map, places=np.tile(here, (3, 1)), metres=0.0)
    stage, ctx = HomingVectorFromMap(), Context("homing")
    found, close, none = (stage.step(ctx, each).vector for each in (map, at_robot, LocalMap(-1, 3, "lost")))
    assert (found.direction, found.turn) == pytest.approx((math.atan2(4.0, 3.0), math.radians(30.0)))
    assert (found.distance, found.ratio, found.depth_ratio, found.metres) == pytest.approx((5.0, 0.2, 0.5, 1.5))
    assert (close.depth_ratio, close.metres) == (1.0, None)
    assert (none.direction, none.turn, none.distance, none.ratio, none.depth_ratio) == (0.0, 0.0, 1.0, 1.0, 1.0)


def test_missing_wires_are_reported() -> None:
    ctx, state, image = Context("tracker"), FeatureTrackerState(), look("mirror", 0.4)
    with pytest.raises(BadInput, match=r"wires\.tracker\.camera=source\.camera"):
        FeatureTracker().step(ctx, state, image)
    donut = Donut(320, 240, 159.5, 119.5, 17.0, 119.0)
    with pytest.raises(BadInput, match=r"no elevations are known .* give its model in camera\.yaml"):
        FeatureTracker().step(ctx, state, image, donut)
    homing, features = Homing(), described("mirror", TARGET)
    alien = Correspondences(np.array([9999]), np.array([0]), np.zeros(1))
    with pytest.raises(BadInput, match="correspondences that are not those of the present features"):
        homing.mapping.step(homing.ctx, homing.mapped, features, homing.target, alien)


def leaning(features: LocalFeatures) -> LocalFeatures:
    """The features as a camera sees them that leans."""
    return replace(features, bearings=features.bearings @ levelling(UP))


@pytest.mark.parametrize("solver", ["planar", "eight_point"])
def test_a_camera_that_leans_is_levelled_once_two_images_show_it(solver: Solver) -> None:
    ctx, state = Context("local_map", np.random.default_rng(0)), LocalMappingState()
    target, mapping, inliers = HomingTarget(3, leaning(described("mirror", TARGET))), LocalMapping(solver=solver), []
    for pose in drive(5, (4.2, 4.6, -1.2), (4.6, 4.8, -0.8)):
        features = leaning(described("mirror", pose))
        matches = matches_with(target, features, matched(features, target.features))
        made, _ = mapping._made(ctx, state, LocalMap(-1, 3, "lost"), matches, 6)
        inliers.append(0 if made is None else made.inliers)
    if solver == "planar":
        assert state.vertical @ UP > math.cos(math.radians(0.5))
        assert min(inliers[-2:]) > 1.5 * inliers[0]
    else:
        assert state.vertical[2] == 1.0

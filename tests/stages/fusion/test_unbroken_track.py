import math
from dataclasses import replace

import numpy as np
import pytest
from landmark_tour import mapped_room, room
from landmark_tour import seen_from as seen_in_room
from landmark_world import NOISE
from made_beliefs import even
from made_words import NOTHING, features_of

from omninav.pipeline import Context
from omninav.stages.camera.equirectangular import Equirectangular
from omninav.stages.fusion.unbroken_track import UnbrokenTrack, UnbrokenTrackState, without_recovery
from omninav.stages.geometry.plane.mount import camera_poses
from omninav.stages.geometry.plane.se2 import between
from omninav.stages.values.belief import Particles
from omninav.stages.values.landmarks import LandmarkFix
from omninav.stages.values.length_scale import LengthScale
from omninav.stages.values.pose import Motion

TWIN = np.array([30.0, 0.0, math.pi])
"""Shift and turn of a hall that looks the same."""
IMAGES = 24


def seen_from(poses: np.ndarray) -> list:
    """Features of images taken at these poses (N, 3) in a long hall, each of 200 points within 6 m ahead or behind."""
    rng = np.random.default_rng(0)
    points = np.column_stack([rng.uniform(-6, 60, 2000), rng.choice([-4.0, 4.0], 2000), rng.uniform(-1, 1.5, 2000)])
    own = rng.gamma(0.5, 40.0, (2000, 128))
    out = []
    for x, y, heading in poses:
        shown = rng.permutation(np.flatnonzero(np.abs(points[:, 0] - x) < 6.0))[:200]
        rays = points[shown] - (x, y, 0.0)
        cos, sin = math.cos(heading), math.sin(heading)
        turned = np.column_stack([cos * rays[:, 0] + sin * rays[:, 1], cos * rays[:, 1] - sin * rays[:, 0], rays[:, 2]])
        turned += NOISE * np.linalg.norm(turned, axis=1)[:, None] * rng.standard_normal(turned.shape)
        looks = np.clip(own[shown] * rng.normal(1.0, 0.1, (200, 128)), 0, 255).astype(np.uint8)
        out.append(replace(features_of(looks), bearings=turned / np.linalg.norm(turned, axis=1)[:, None]))
    return out


def fix_at(pose: np.ndarray, probability: float = 0.99) -> LandmarkFix:
    exact = np.diag([0.005, 0.005, 0.002])[None] ** 2
    return LandmarkFix(pose[None], exact, np.array([60]), np.array([probability]), 80)


def driven(
    twin_from: int,
    jump_at: int | None = None,
    turned_at: int | None = None,
    turn: float = math.pi,
    probability: float = 0.96,
    scale: float = 0.5,
    dark_at: int | None = None,
    step: float = 0.3,
    twin: np.ndarray = TWIN,
) -> list:
    """Drives ahead, and returns the stage's output for each image. From image `twin_from` on landmarks show a `twin`
    so far away; at `jump_at` the robot is carried 40 m ahead, and at `turned_at` turned by `turn`, which odometry does
    not measure; the one of `dark_at` shows nothing."""
    believed = np.column_stack([step * np.arange(IMAGES), np.zeros(IMAGES), np.full(IMAGES, 0.1)])
    poses = believed.copy()
    if jump_at is not None:
        poses[jump_at:, 0] += 40.0
    if turned_at is not None:
        poses[turned_at:, 2] += turn
    images, state, stage, out = seen_from(poses), UnbrokenTrackState(), UnbrokenTrack(), []
    if dark_at is not None:
        images[dark_at] = NOTHING
    for n in range(IMAGES):
        motion = Motion(*between(believed[n - 1], believed[n]).tolist()) if n else None
        spread = np.random.default_rng(n).normal(0.0, 0.05, (100, 3))
        belief = Particles(np.concatenate([believed[n] + spread, TWIN[None]]), np.full(101, 1 / 101), 1)
        fix = fix_at(believed[n] if n < twin_from else believed[n] + twin, probability)
        ctx = Context("track", np.random.default_rng(0))
        out.append(stage.step(ctx, state, belief, images[n], fix, motion, LengthScale(scale)))
    return out


def test_a_hall_that_looks_the_same_is_left_out_for_as_long_a_way_as_the_track_was_confirmed():
    out = driven(twin_from=10)
    assert [each.fix is not None for each in out] == [True] * 10 + [False] * 8 + [True] * 6  # 9 x 0.3 m before
    assert all(each.track.unbroken and not each.belief.recovery_particles for each in out[10:18])
    assert out[-1].belief.recovery_particles == 1


def test_landmarks_count_that_show_the_turn_which_odometry_missed():
    swung = np.array([0.0, 0.0, 0.7])
    assert all(each.fix is not None for each in driven(10, turned_at=10, turn=0.7, twin=swung))
    assert not any(each.fix is not None for each in driven(10, twin=swung)[10:14])


def test_the_next_of_shelves_that_look_the_same_is_left_out():
    out = driven(twin_from=10, twin=np.array([-0.9, 0.0, 0.0]))
    assert all(each.fix is None and each.track.unbroken for each in out[10:16])


@pytest.mark.parametrize("moved", ["jump_at", "turned_at"])
def test_a_robot_that_was_carried_or_turned_on_the_spot_may_be_anywhere_at_once(moved):
    out = driven(10, **{moved: 10})
    assert all(each.fix is not None for each in out)
    assert not out[10].track.unbroken


def test_an_image_of_other_surroundings_tells_that_the_robot_was_carried_and_blinking_eyes_do_not():
    away = driven(twin_from=10, jump_at=10, probability=0.9)  # landmarks are never sure
    assert [n for n, each in enumerate(away) if each.track.carried] == [10]
    assert not any(each.track.carried for each in driven(twin_from=10, probability=0.9, dark_at=10))
    assert not any(each.track.carried for each in driven(twin_from=10, jump_at=10, dark_at=10, probability=0.9))
    assert not any(each.track.carried for each in driven(twin_from=10, probability=0.9, step=1.5))


@pytest.mark.parametrize(("way", "turn", "carried"), [(0.59, 29.0, True), (0.0, 31.0, False), (0.61, 0.0, False)])
def test_a_narrow_view_that_has_moved_or_turned_out_of_what_it_saw_was_not_carried(way, turn, carried):
    state, stage, ctx = UnbrokenTrackState(), UnbrokenTrack(), Context("track", np.random.default_rng(0))
    belief = even(np.zeros((2, 3)))
    first, other = seen_from(np.array([[0.0, 0.0, 0.0], [40.0, 0.0, 0.0]]))
    assert not stage.step(ctx, state, belief, first, None, None).track.carried
    motion = Motion(0.6 * way, 0.8 * way, math.radians(turn))
    assert stage.step(ctx, state, belief, other, None, motion).track.carried is carried


def test_a_track_that_was_never_sure_rules_nothing_out():
    assert all(each.fix is not None and not each.track.unbroken for each in driven(10, probability=0.94))


@pytest.mark.parametrize("confirmed", [1, 3])
def test_one_sure_pose_after_a_way_without_rules_nothing_out_and_three_do(confirmed: int):
    """It may be of the next shelf, and a robot that then stands has no way on which others could speak against it."""
    state, stage, ctx = UnbrokenTrackState(), UnbrokenTrack(), Context("track", np.random.default_rng(0))
    poses = np.column_stack([0.1 * np.arange(20.0), np.zeros((20, 2))])
    poses[12:] = poses[12]
    fixes = [None] * 10 + [fix_at(poses[10 + n]) for n in range(confirmed)]
    fixes += [fix_at(poses[12] + (0.9, 0.0, 0.0), 0.8)] * (20 - len(fixes))
    out = []
    for n, image in enumerate(seen_from(poses)):
        motion = Motion(*between(poses[n - 1], poses[n]).tolist()) if n else None
        out.append(stage.step(ctx, state, even(poses[[n]]), image, fixes[n], motion, LengthScale(0.5)))
    assert [each.fix is not None for each in out[13:]] == [confirmed == 1] * 7


def test_a_track_leads_as_far_off_as_odometry_may_drift_and_the_robot_may_have_been_carried():
    # After 4 m: 0.3 + 0.5 + 4 / 4 m, and 30 + 4 x 5 degrees.
    state = UnbrokenTrackState(pose=np.array([1.0, 2.0, 3.0]), confirmed=9.0, since=4.0, carried=0.5)
    for way, turn, leads in ((1.79, 49.0, True), (1.81, 0.0, False), (0.0, 51.0, False)):
        pose = np.array([1.0 + 0.6 * way, 2.0 + 0.8 * way, math.radians(turn) + 3.0 - 2.0 * math.pi])
        assert state.leads_to(pose) is leads


def test_each_pose_confirms_two_length_scales_of_the_track_at_most_and_all_of_them_twenty():
    state, stage, ctx = UnbrokenTrackState(), UnbrokenTrack(), Context("track")
    confirmed = []
    for n in range(12):
        belief, motion = even([[5.0 * n, 0.0, 0.0]]), Motion(5.0, 0.0, 0.0) if n else None
        stage.step(ctx, state, belief, NOTHING, fix_at(belief.poses[0]), motion, LengthScale(2.0))
        confirmed.append(state.confirmed)
    assert confirmed == [0, 4, 8, 12, 16, 20, 24, 28, 32, 36, 40, 40]


def test_a_track_is_forgotten_after_a_hundred_length_scales_without_a_pose():
    state, stage, ctx = UnbrokenTrackState(confirmed=5.0, since=49.0), UnbrokenTrack(), Context("track")
    how = None, None, Motion(0.0, 0.6, 0.0), LengthScale(0.5)
    unbroken = [stage.step(ctx, state, even(np.zeros((2, 3))), *how).track.unbroken for _ in range(2)]
    assert unbroken == [True, False]


@pytest.mark.parametrize(("probability", "there", "against"), [(0.5, 1, 0.5), (0.49, 1, 0.0), (0.5, 2, 0.0)])
def test_only_a_pose_that_is_rather_right_and_hardly_believed_counts_against_the_track(probability, there, against):
    state, fix, poses = UnbrokenTrackState(), fix_at(np.array([9.0, 0.0, 0.0]), probability), np.zeros((50, 3))
    poses[:there, 0] = 9.0
    UnbrokenTrack().step(Context("track"), state, even(poses), NOTHING, fix, Motion(0.3, 0.4, 0.0))
    assert state.against == pytest.approx(against)


def test_without_recovery_particles_the_others_share_the_weight():
    found = without_recovery(Particles(np.eye(3), np.array([0.125, 0.375, 0.5]), 1))
    assert (found.weights.tolist(), found.recovery_particles) == ([0.25, 0.75], 0)
    lost = Particles(np.eye(3), np.array([0.0, 0.0, 1.0]), 1)
    assert without_recovery(lost) is lost  # it is all that is left


def test_the_track_goes_on_from_the_likeliest_of_the_poses_and_where_the_belief_gave_way_after_as_long_a_way():
    poses = np.column_stack([0.25 * np.arange(5.0), np.full(5, 2.0), np.full(5, 0.3)])
    state, stage, tracks = UnbrokenTrackState(), UnbrokenTrack(), []
    for n, image in enumerate(seen_from(poses)):
        here = poses[n] + (0.0 if n < 3 else 9.0, 0.0, 0.0)
        fix = replace(
            fix_at(here),
            poses=np.stack([here, here + 5.0]),
            covariances=np.tile(np.eye(3) * 1e-4, (2, 1, 1)),
            inliers=np.array([60, 9]),
            probabilities=np.array([0.99, 0.01]),
        )
        motion = Motion(*between(poses[n - 1], poses[n]).tolist()) if n else None
        assert stage.step(Context("track"), state, even(np.tile(here, (4, 1))), image, fix, motion).fix is fix
        tracks.append([state.pose[0], state.confirmed, state.elsewhere])
    assert tracks == [pytest.approx(each) for each in (
        [0.0, 0.0, 0.0], [0.25, 0.25, 0.0], [0.5, 0.5, 0.0], [0.75, 0.5, 0.25], [10.0, 0.5, 0.0]
    )]  # fmt: skip


def test_a_rival_elsewhere_is_left_out_and_the_pose_on_the_track_is_as_probable_as_without_it():
    pose, poses = np.zeros(3), np.array([[0.0, 0.0, 0.0], [5.0, 0.0, 0.0]])
    rivals = replace(fix_at(pose), poses=poses[::-1], inliers=np.array([40, 30]), probabilities=np.array([0.9, 0.08]))
    rivals = replace(rivals, covariances=np.tile(np.eye(3) * 1e-4, (2, 1, 1)), agree=np.array([0, 1, -1, 1], np.int8))
    only = rivals.without(np.array([True, False]))
    assert only.poses.tolist() == [pose.tolist()]
    assert only.probabilities == pytest.approx([0.8])
    assert only.agree.tolist() == [-1, 0, -1, 0]


def test_a_camera_that_swings_round_with_its_robot_was_not_carried() -> None:
    mount, camera = (
        np.array([0.6, 0.0, 0.0]),
        Equirectangular(1024, 512, 512.0, elevation_top=1.5, elevation_bottom=-1.5),
    )
    plain = mapped_room()
    map = replace(plain, landmarks=replace(plain.landmarks, mount=mount))
    robot = np.column_stack([np.full(6, 5.0), np.full(6, 3.0), 0.7 * np.arange(6)])
    carried = {}
    for where, wired in (("told", {"map": map, "camera": camera}), ("untold", {"map": map})):
        state, stage, ctx = UnbrokenTrackState(), UnbrokenTrack(), Context("track", np.random.default_rng(0))
        for n, pose in enumerate(robot):
            features = seen_in_room(room(), camera_poses(pose, mount))
            motion = Motion(0.0, 0.0, 0.7) if n else None
            stage.step(ctx, state, Particles(pose[None], np.ones(1)), features, None, motion, **wired)
        carried[where] = state.carried
    assert carried == {"told": 0.0, "untold": 5.0}

"""Motion that is seen in images, where only a guess of it is given."""

import functools
import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from made_tour import Landmarks as Points

from omninav.pipeline import BadInput, Context, Tick
from omninav.pipeline.engine.codec import decode, encode, encode_state, restore_state
from omninav.stages.features.rotation_reduced_sift import none_found
from omninav.stages.geometry.landmarks.adjustment import rotations_about
from omninav.stages.geometry.plane.mount import robot_poses
from omninav.stages.geometry.plane.se2 import between, compose
from omninav.stages.motion.visual_odometry import VisualOdometry, VisualOdometryState, _scale_by_map
from omninav.stages.source.dead_reckoning import assumed_motion
from omninav.stages.values.landmarks import LandmarkFix
from omninav.stages.values.pose import AssumedMotion, AssumedPose, Motion, Pose

GUESS = AssumedMotion(0.37, 0.0, 0.0, 0.5, 0.5)
STEP_M = 0.2
FLOOR_M = 0.9


@functools.cache
def room(floor: bool) -> Points:
    rng = np.random.default_rng(0)
    walls = rng.uniform([0, 0, 0.1], [12, 6, 2.2], (700, 3))
    if not floor:
        walls[:, 2] += 0.4 * (walls[:, 2] < 0.9)
    ground = rng.uniform([0, 0, 0], [12, 6, 0], (600 if floor else 0, 3))
    return Points(np.concatenate([walls, ground]))


def walk(images: int) -> np.ndarray:
    """Poses (N, 3) along a bend, an arc to the left."""
    poses = [np.array([2.0, 1.5, 0.0])]
    for _ in range(images - 1):
        poses.append(compose(poses[-1], (STEP_M, 0.0, 0.04)))
    return np.array(poses)


NONE = np.zeros(3)
"""Mount of a camera on the robot's axis."""


def run(
    points,
    poses: np.ndarray,
    height: float | None = None,
    hidden=(),
    fixes=None,
    kept=False,
    log=0,
    mount=NONE,
    tilt_deg=0.0,
    **options,
):
    """The stage's output for each image; `hidden` ones show nothing. `kept`: its state goes through bytes.

    `tilt_deg`: standard deviation of the camera's roll and pitch, in each image others.
    """
    stage, state, ctx = VisualOdometry(**options), VisualOdometryState(), Context("seen", np.random.default_rng(0))
    rng, outs, ctx.tick = np.random.default_rng(1), [], Tick(0, 0, log)
    for number, pose in enumerate(poses):
        features = points.seen(Pose(*pose.tolist()), 3.0)
        bearings = features.bearings + rng.normal(0.0, math.radians(0.05), features.bearings.shape)
        if tilt_deg:
            roll, pitch = np.radians(rng.normal(0.0, tilt_deg, (2, 1)))
            bearings = bearings @ (rotations_about(pitch, 1) @ rotations_about(roll, 0))[0]
        features = replace(features, bearings=bearings / np.linalg.norm(bearings, axis=1, keepdims=True))
        if number in hidden:
            features = none_found()
        motion = None if number == 0 else GUESS
        if kept:
            fresh = VisualOdometryState()
            restore_state(fresh, decode(encode(encode_state(state))))
            state = fresh
        camera, fix = (
            SimpleNamespace(height=height, arm=mount),
            None if fixes is None or not number else fixes[number - 1],
        )
        outs.append(stage.step(ctx, features, camera, motion, AssumedPose(0.0, 0.0, 0.0), state, fix))
    return outs, ctx


@functools.cache
def run_over_floor():
    return run(room(floor=True), walk(30), FLOOR_M)


def path(outs) -> np.ndarray:
    return np.array([(out.odometry.x, out.odometry.y, out.odometry.heading) for out in outs])


def scale_of(outs, poses) -> float:
    return float(np.hypot(*path(outs)[-1, :2]) / np.hypot(*(poses[-1] - poses[0])[:2]))


def test_a_path_has_its_shape_and_turns_where_its_scale_is_not_known() -> None:
    poses = walk(40)
    outs, ctx = run(room(floor=False), poses)
    scale = scale_of(outs, poses)
    assert scale == pytest.approx(GUESS.x / STEP_M, rel=0.35)  # as was guessed of the first motion
    true = between(poses[0], poses)
    assert path(outs)[:, :2] == pytest.approx(scale * true[:, :2], abs=0.03 * scale * np.hypot(*true[-1, :2]))
    assert path(outs)[:, 2] == pytest.approx(true[:, 2], abs=math.radians(0.5))
    assert "guess" in ctx.facts["scale"]
    assert outs[-1].motion.sigma_m > 0.4 * STEP_M * scale
    assert any("camera.yaml (height: 1.2)" in sentence for sentence in ctx.warnings)


def test_at_a_speed_of_zero_lengths_are_those_of_half_a_metre_a_second(monkeypatch: pytest.MonkeyPatch) -> None:
    outs, _ = run(room(floor=False), walk(8))
    seconds = GUESS.x / 0.5
    still = replace(assumed_motion(None, None, seconds, 0.0), sigma_turn=GUESS.sigma_turn)
    monkeypatch.setitem(globals(), "GUESS", still)
    assert path(run(room(floor=False), walk(8))[0]) == pytest.approx(path(outs))


def test_the_cameras_height_over_the_floor_gives_metres() -> None:
    outs, ctx = run_over_floor()
    lengths = np.array([math.hypot(out.motion.x, out.motion.y) for out in outs[1:]])
    assert lengths[10:] == pytest.approx(STEP_M, abs=0.012)
    assert "floor" in ctx.facts["scale"]
    assert not ctx.warnings


def test_the_motion_is_seen_by_a_camera_whose_tilt_changes() -> None:
    poses = walk(30)
    outs, ctx = run(room(floor=True), poses, FLOOR_M, tilt_deg=4.0)
    true, moved = between(poses[0], poses), np.array([(out.motion.x, out.motion.y) for out in outs[1:]])
    assert np.hypot(*moved[10:].T) == pytest.approx(STEP_M, abs=0.025)
    assert path(outs)[:, 2] == pytest.approx(true[:, 2], abs=math.radians(1.0))
    assert not ctx.counts


def test_the_motion_is_that_of_the_robot_under_a_camera_in_front_of_its_axis() -> None:
    poses, mount = walk(30), np.array([0.3, 0.1, 0.0])
    robot = robot_poses(poses, mount)
    outs, _ = run(room(floor=True), poses, FLOOR_M, mount=mount)
    beside, _ = run_over_floor()
    true = between(robot[0], robot)
    missed, without = (np.hypot(*(path(each) - true)[20:, :2].T).mean() for each in (outs, beside))
    assert missed < 0.5 * without


def fix_at(pose: np.ndarray) -> LandmarkFix:
    return LandmarkFix(
        pose[None], np.eye(3)[None], np.array([50]), np.array([0.99]), 50, np.empty((0, 3), np.float32),
        np.empty(0, np.int8),
    )  # fmt: skip


def test_poses_by_the_maps_landmarks_give_metres() -> None:
    poses = walk(30)
    outs, ctx = run(room(floor=False), poses, fixes=[fix_at(pose) for pose in poses])
    lengths = np.array([math.hypot(out.motion.x, out.motion.y) for out in outs[1:]])
    assert lengths[10:] == pytest.approx(STEP_M, abs=0.012)
    assert "the map's landmarks" in ctx.facts["scale"]


def test_three_ways_by_the_maps_landmarks_that_agree_give_the_scale() -> None:
    state, exact = VisualOdometryState(), np.eye(3)[None] * 1e-4

    def at(seen: float, true: float, probability: float = 0.95, fixed: bool = True) -> tuple[list[float], bool]:
        state.pose = np.array([1.0, 2.0 + seen, 0.3])
        pose = np.array([[true, 5.0, 0.3]])
        fix = LandmarkFix(pose, exact, np.array([60]), np.array([probability]), 80) if fixed else None
        _scale_by_map(state, fix, NONE)
        return state.map_scales.tolist(), state.by_map

    at(0.0, 0.0, fixed=False)
    at(0.0, 0.0, 0.94)
    assert state.anchor is None
    assert at(0.0, 0.0) == ([], False)
    assert at(0.14, 0.28) == ([], False)  # too short a way
    assert at(0.5, 1.0) == ([pytest.approx(2.0)], False)
    assert at(0.55, 2.0) == ([pytest.approx(2.0)], False)  # twenty times as far: wrong
    assert at(1.05, 2.75) == (pytest.approx([2.0, 1.5]), False)
    at(1.55, 3.75)
    assert at(2.05, 4.75) == (pytest.approx([2.0, 1.5, 2.0, 2.0]), False)
    assert not len(state.scales)
    at(2.5, 5.75)  # the last three are within a fifth
    assert state.by_map
    assert state.scales == pytest.approx(np.array([2.0, 1.5, 2.0, 2.0, 1.0 / 0.45]) / 2.0)
    assert state.map_scales.tolist() == state.scales.tolist()
    assert state.pose == pytest.approx([2.0, 9.0, 0.3])
    assert state.speed_ratio == pytest.approx(2.0)
    assert state.anchor == pytest.approx(np.array([[2.0, 9.0], [5.75, 5.0]]))


def test_one_jump_of_these_poses_gives_no_scale() -> None:
    poses = walk(20)
    fixes: list[LandmarkFix | None] = [None] * len(poses)
    fixes[5], fixes[9] = fix_at(poses[5]), fix_at(poses[9] + [2.0, 0.0, 0.0])
    once, again = run(room(floor=False), poses, fixes=fixes)[0], run(room(floor=False), poses)[0]
    assert path(once).tobytes() == path(again).tobytes()


def test_a_camera_that_stands_or_turns_on_the_spot_does_not_move() -> None:
    for turn in (0.0, 0.3):
        drive = walk(12)
        there = np.array([compose(drive[-1], (0.0, 0.0, turn * n)) for n in range(1, 9)])
        outs, _ = run(room(floor=True), np.concatenate([drive, there]), FLOOR_M)
        for out in outs[-8:]:
            assert math.hypot(out.motion.x, out.motion.y) < 0.01
            assert out.motion.turn == pytest.approx(turn, abs=math.radians(0.3))


def test_a_camera_that_has_not_moved_yet_stands() -> None:
    outs, _ = run(room(floor=True), np.repeat(walk(1), 8, axis=0), FLOOR_M)
    assert np.hypot(*path(outs)[7, :2]) == 0.0
    assert all(0.0 < out.motion.sigma_m < 0.1 for out in outs[1:])


def test_images_without_points_go_on_by_the_usual_step_and_the_next_one_corrects_it() -> None:
    drive = walk(30)
    stood = np.concatenate([drive[:20], np.repeat(drive[19:20], 4, axis=0), drive[20:]])
    for poses, hidden in ((drive, (20, 21)), (stood, (20, 21, 22, 27))):
        outs, ctx = run(room(floor=True), poses, FLOOR_M, hidden=hidden)
        for number in hidden:
            assert outs[number].motion.x == pytest.approx(STEP_M, abs=0.02)
            assert outs[number].motion.sigma_m == GUESS.sigma_m
        assert path(outs)[24, :2] == pytest.approx(between(poses[0], poses)[24, :2], abs=0.06)
        assert ctx.counts["motion_not_seen"] == len(hidden)


def test_after_too_many_images_without_points_the_scale_is_found_anew() -> None:
    poses = [*walk(18)]
    for _ in range(30):
        poses.append(compose(poses[-1], (STEP_M / 2, 0.0, 0.02)))
    outs, _ = run(room(floor=True), np.array(poses), FLOOR_M, hidden=range(10, 18))
    lengths = np.array([math.hypot(out.motion.x, out.motion.y) for out in outs[1:]])
    sigmas = np.array([out.motion.sigma_m for out in outs[1:]])
    assert sigmas[18] == pytest.approx(0.51 * lengths[18], rel=0.01)  # not taken for known
    assert lengths[18:] == pytest.approx(STEP_M / 2, abs=0.015)


def test_images_that_hold_no_points_are_refused_unless_a_speed_is_stated() -> None:
    poses = walk(8)
    with pytest.raises(BadInput, match=r"first 5 images, of which the last shows 0 points; .* type speed=0\.5"):
        run(room(floor=True), poses, hidden=range(8))
    with pytest.raises(BadInput, match=r"no motion is seen .* type speed=0\.5"):
        run(room(floor=True), poses, hidden=range(8), speed_m_s=0.0)
    assert run(room(floor=True), poses, hidden=range(8), log=1)[1].counts["motion_not_seen"] == 7
    outs, _ = run(room(floor=True), poses, hidden=range(8), speed_m_s=0.74)
    assert all(vars(out.motion) == vars(GUESS) for out in outs[1:])


def test_a_run_that_goes_on_from_its_saved_state_sees_the_same_to_the_last_bit() -> None:
    poses = walk(16)
    once, again = (run(room(floor=True), poses, FLOOR_M, hidden=(9,), kept=kept)[0] for kept in (False, True))
    assert path(once).tobytes() == path(again).tobytes()


def test_motions_that_were_measured_stay() -> None:
    stage, state = VisualOdometry(), VisualOdometryState()
    motion, odometry = Motion(0.1, 0.0, 0.2), Pose(3.0, 1.0, 0.0)
    features = room(floor=True).seen(odometry)
    out = stage.step(Context("seen"), features, SimpleNamespace(height=None, arm=NONE), motion, odometry, state)
    assert out.motion is motion
    assert out.odometry is odometry

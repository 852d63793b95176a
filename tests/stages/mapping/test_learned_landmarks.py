import math
from dataclasses import replace

import numpy as np
import pytest
from landmark_tour import HEIGHT_M, graph_of, mapped_room, room, seen_from, tour_poses, with_landmarks
from made_words import NOTHING
from scipy.spatial import KDTree

from omninav.pipeline import Context, Tick
from omninav.stages.camera.equirectangular import Equirectangular
from omninav.stages.geometry.landmarks.adjustment import rotations_about
from omninav.stages.geometry.plane.mount import camera_poses, robot_poses
from omninav.stages.geometry.plane.se2 import between, chain, compose, wrap
from omninav.stages.mapping.learned_landmarks import LearnLandmarks
from omninav.stages.mapping.learned_words import LearnVisualWords
from omninav.stages.recordings.camera_yaml import parse_camera
from omninav.stages.values.landmarks import DESCRIPTOR_SCALE
from omninav.stages.values.local_features import LocalFeatures
from omninav.stages.values.maps import ReferenceEvent
from omninav.stages.values.pose import Pose


def seen_along(poses: np.ndarray) -> list[LocalFeatures | None]:
    return [seen_from(room(), pose) for pose in poses]


def test_points_of_the_room_are_found_to_a_millimetre_and_known_by_their_looks() -> None:
    landmarks = mapped_room().landmarks
    where = room().where - (0.0, 0.0, HEIGHT_M)
    looks = np.sqrt(room().looks / room().looks.sum(axis=1, keepdims=True))
    gap, nearest = KDTree(where).query(landmarks.points)
    assert len(landmarks) > 400
    assert gap.max() < 1e-3
    assert landmarks.descriptors / DESCRIPTOR_SCALE == pytest.approx(looks[nearest], abs=1.1 / DESCRIPTOR_SCALE)


def test_references_see_the_landmarks_around_them() -> None:
    map = mapped_room()
    landmarks = map.landmarks
    assert landmarks.references == len(landmarks.words) == len(map)
    for reference, pose in enumerate(map.poses):
        own = landmarks.seen_by(np.array([reference]))
        assert len(own) > 50
        assert np.hypot(*(landmarks.points[own, :2] - pose[:2]).T).max() < 3.01
    assert (np.bincount(landmarks.seen, minlength=len(landmarks)) >= 2).all()


def test_only_images_that_became_references_are_used() -> None:
    poses = tour_poses(0.2)[:20]
    features = seen_along(poses)
    some = with_landmarks(graph_of(poses[::2]), features, [n % 2 == 0 for n in range(20)])
    alone = with_landmarks(graph_of(poses[::2]), features[::2])
    assert some.landmarks.references == 10
    assert len(some.landmarks) > 50
    assert some.landmarks.points.tobytes() == alone.landmarks.points.tobytes()
    assert some.landmarks.descriptors.tobytes() == alone.landmarks.descriptors.tobytes()


def test_a_map_of_national_coordinates_is_as_exact() -> None:
    poses, origin = tour_poses(0.2)[:20], np.array([5e5, 5.4e6, 0.0])
    here, there = (with_landmarks(graph_of(at), seen_along(poses)) for at in (poses, poses + origin))
    assert len(here.landmarks) == len(there.landmarks) > 50
    assert np.abs(there.landmarks.points - origin - here.landmarks.points).max() < 1e-4


def test_a_tour_of_one_image_is_warned_of() -> None:
    poses, ctx, events = tour_poses()[:1], Context("landmarks"), [ReferenceEvent(0, "far")]
    words = LearnVisualWords(words=300).step(Context("words"), seen_along(poses), events).words
    assert not LearnLandmarks().step(ctx, seen_along(poses), events, graph_of(poses), words).map.landmarks.points.size
    assert "the tour shows no landmarks: 1 image with" in ctx.warnings[0]


def test_next_to_nothing_agrees_in_the_images_of_a_mirrored_camera() -> None:
    poses = tour_poses()
    mirrored = [replace(each, bearings=each.bearings * [1.0, -1.0, 1.0]) for each in seen_along(poses)]
    found = with_landmarks(graph_of(poses), mirrored).landmarks
    assert len(found.seen) < 0.1 * len(mapped_room().landmarks.seen)


def test_images_without_features_one_reference_or_none_give_a_map_without_landmarks() -> None:
    poses = tour_poses()[:3]
    for number, features in ((3, [NOTHING, None, NOTHING]), (1, seen_along(poses[:1])), (0, [])):
        landmarks = with_landmarks(graph_of(poses[:number]), features).landmarks
        assert (len(landmarks), landmarks.references) == (0, number)
        assert landmarks.seen_by(np.arange(number)).shape == (0,)


def test_a_black_image_among_others_sees_nothing() -> None:
    poses = tour_poses()[:10]
    features = seen_along(poses)
    features[3] = NOTHING
    landmarks = with_landmarks(graph_of(poses), features).landmarks
    assert [bool(len(landmarks.seen_by(np.array([n])))) for n in range(10)] == [n != 3 for n in range(10)]


def learned(poses: np.ndarray, source: str, features: list, **more):
    events = [ReferenceEvent(n, "far") for n in range(len(poses))]
    words = LearnVisualWords(words=300).step(Context("words"), features, events).words
    ctx = Context("landmarks")
    map = replace(graph_of(poses), pose_source=source)
    return ctx, LearnLandmarks().step(ctx, features, events, map, words, **more)


def test_references_of_wrong_poses_come_to_where_they_were_with_their_landmarks() -> None:
    poses = tour_poses()
    wrong = poses + np.random.default_rng(0).normal(size=poses.shape) * [0.1, 0.1, np.radians(2.0)]
    ctx, out = learned(wrong, "truth", seen_along(poses))
    assert np.hypot(*(out.map.poses - poses)[:, :2].T).max() < 0.06
    gap, _ = KDTree(room().where - (0.0, 0.0, HEIGHT_M)).query(out.map.landmarks.points)
    assert np.median(gap) < 0.06
    assert ctx.facts["map_adjusted"].startswith("poses and landmarks together, by 0.")
    assert out.metrics.values["landmarks"]["moved_median_m"] > 0.05
    assert out.map.landmarks.pose_sigmas.shape == (len(poses), 3)
    assert (out.map.landmarks.pose_sigmas > 0.0).all()
    assert 0.0005 < out.metrics.values["landmarks"]["pose_sigma_m"] < 0.1


@pytest.mark.parametrize("source", ["truth", "odometry"])
@pytest.mark.parametrize("with_camera", [False, True])
def test_images_that_lean_each_by_themselves_give_a_map_as_exact(source: str, with_camera: bool) -> None:
    poses, camera = tour_poses(0.3), Equirectangular(1024, 512, 512.0, elevation_top=1.5, elevation_bottom=-1.5)
    tilts = np.random.default_rng(4).normal(0.0, math.radians(4.0), (len(poses), 2))
    turns = rotations_about(tilts[:, 1], 1) @ rotations_about(tilts[:, 0], 0)
    features = []
    for each, turn in zip(seen_along(poses), turns, strict=True):
        pixels, shown = camera.project(each.bearings @ turn)
        features.append(replace(each, points=pixels, bearings=camera.unproject(pixels)[0]).chosen(shown))
    ctx, out = learned(poses, source, features, **({"camera": camera} if with_camera else {}))
    gap, _ = KDTree(room().where - (0.0, 0.0, HEIGHT_M)).query(out.map.landmarks.points)
    assert len(out.map.landmarks) > 400
    assert np.median(gap) < 0.01
    assert np.hypot(*(out.map.poses - poses)[:, :2].T).max() < 0.01
    assert ctx.facts["leaning_images"].startswith("by 4.") or ctx.facts["leaning_images"].startswith("by 5.")
    assert "leaning_images" not in learned(poses, source, seen_along(poses))[0].facts


def test_a_tour_by_odometry_is_straightened_from_how_it_was_driven() -> None:
    poses = tour_poses()
    motions = between(poses[:-1], poses[1:])
    motions[:, 2] += 0.01
    odometry = compose(poses[0], np.concatenate([np.zeros((1, 3)), chain(motions)]))
    elsewhere = odometry + np.array([5.0, 0.0, 0.0])  # what appearance made of it
    as_driven = replace(graph_of(odometry), pose_source="odometry")
    ctx, out = learned(elsewhere, "odometry", seen_along(poses), as_driven=as_driven)
    assert np.hypot(*(odometry - poses)[:, :2].T).max() > 1.0
    assert np.hypot(*(out.map.poses - poses)[:, :2].T).max() < 0.1
    assert out.map.poses[0] == pytest.approx(poses[0], abs=1e-5)
    assert "odometry's scale" in ctx.facts["map_adjusted"]
    assert 0.002 < np.median(out.map.landmarks.pose_sigmas[:, :2]) < 0.05  # as odometry could have it


def test_a_tour_in_whose_pause_the_robot_was_carried_is_told_and_its_map_is_right() -> None:
    whole = tour_poses()
    poses = np.concatenate([whole[:5], whole[18:]])  # carried from one end of the room to the other
    motions = between(poses[:-1], poses[1:])
    motions[4] = 0.0
    odometry = compose(poses[0], np.concatenate([np.zeros((1, 3)), chain(motions)]))
    ctx, out = learned(odometry, "odometry", seen_along(poses))
    assert [warning for warning in ctx.warnings if "was carried in the tour between references 4 and 5: " in warning]
    assert np.hypot(*(odometry - poses)[:, :2].T).max() > 3.0
    assert np.hypot(*(out.map.poses - poses)[:, :2].T).max() < 0.1


def test_a_tour_in_two_parts_that_share_nothing_is_told() -> None:
    whole = tour_poses()
    poses = np.concatenate([whole[:5], whole[18:32]])  # both ends of the room, and no way back
    motions = between(poses[:-1], poses[1:])
    motions[4] = 0.0
    odometry = compose(poses[0], np.concatenate([np.zeros((1, 3)), chain(motions)]))
    ticks = [Tick(n, 10**9 * n) for n in range(len(poses))]
    ctx, _ = learned(odometry, "odometry", seen_along(poses), ticks=ticks)
    told = "the robot may have been carried in the tour between references 4 and 5 (4.0 s to 5.0 s): their images share"
    assert [warning for warning in ctx.warnings if warning.startswith(told)]


def test_where_too_little_is_seen_the_poses_stay_and_it_is_said() -> None:
    poses = tour_poses()[:6]
    for source in ("truth", "odometry"):
        ctx, out = learned(poses, source, [NOTHING] * len(poses))
        assert (out.map.poses == poses).all()
        assert ctx.facts["map_adjusted"].startswith("no: ")
        assert out.map.landmarks.pose_sigmas is None


CAMERA = Equirectangular(1024, 512, 512.0, elevation_top=math.pi / 2, elevation_bottom=-math.pi / 2)


@pytest.mark.parametrize(
    ("source", "mount"),
    [
        ("truth", (0.1, 0.0, 0.0)),
        ("truth", (0.5, -0.2, 0.0)),
        ("odometry", (0.5, -0.2, math.radians(8.0))),  # given poses tell a turn with the camera's axis
    ],
)
def test_where_a_camera_sits_on_the_robot_is_found_and_its_map_is_as_exact(source, mount) -> None:
    poses = tour_poses()
    robot = robot_poses(poses, np.array(mount))
    ctx, out = learned(robot, source, seen_along(poses), camera=CAMERA)
    landmarks = out.map.landmarks
    assert landmarks.mount == pytest.approx(mount, abs=0.005)
    assert np.hypot(*(out.map.poses - robot)[:, :2].T).max() < 0.02
    gap, _ = KDTree(room().where - (0.0, 0.0, HEIGHT_M)).query(landmarks.points)
    assert np.median(gap) < 0.01
    right = parse_camera(landmarks.camera, "camera.yaml")
    assert right.mount == pytest.approx(mount, abs=0.005)
    assert "it sits at x = " in ctx.warnings[0]
    assert out.metrics.values["camera"]["position_beside_m"] == pytest.approx(math.hypot(*mount[:2]), abs=0.005)


def swinging(seconds: np.ndarray) -> np.ndarray:
    """Poses there and back along the room, swinging to both sides, at times (s) from 0 to 40."""
    there = np.abs(20.0 - seconds)
    return np.column_stack([1.0 + 0.5 * there, 2.5 + (seconds > 20.0), wrap(0.7 * seconds + np.sin(seconds))])


STAMPS = np.arange(12.0, 28.0, 0.2)
TICKS = [Tick(n, round(at * 1e9)) for n, at in enumerate(STAMPS.tolist())]


@pytest.mark.parametrize(("source", "beside"), [("truth", 0.0), ("truth", 0.3), ("odometry", 0.3)])
def test_how_late_images_are_is_found_with_where_the_camera_sits(source, beside) -> None:
    camera = replace(CAMERA, delay=0.05)
    features = seen_along(camera_poses(swinging(STAMPS - 0.15), np.array([beside, 0.0, 0.0])))
    robot = [Pose(*pose) for pose in swinging(STAMPS).tolist()]
    poses = {"odometry": robot, "truth": robot if source == "truth" else [None] * len(robot)}
    ctx, out = learned(swinging(STAMPS), source, features, camera=camera, ticks=TICKS, **poses)
    landmarks = out.map.landmarks
    assert landmarks.late_by(0.05) == pytest.approx(0.15, abs=0.01)
    assert landmarks.late_by(0.2) == 0.0  # another description is believed
    assert landmarks.late_by(None) == pytest.approx(0.2, abs=0.01)  # and none leaves it to the tour
    assert landmarks.mounted(np.array([1.0, 0.0, 0.0]), True) == pytest.approx([1.0, 0.0, 0.0])
    for yaw in (camera.yaw, camera.yaw + 0.5):
        assert landmarks.mounted(np.array([0.0, 0.0, yaw]), False) == pytest.approx([beside, 0.0, 0.0], abs=0.02)
    assert landmarks.mount == pytest.approx([beside, 0.0, 0.0], abs=0.02)
    assert np.median(np.hypot(*(out.map.poses - swinging(STAMPS - 0.15))[:, :2].T)) < 0.04
    assert parse_camera(landmarks.camera, "camera.yaml").delay == pytest.approx(0.2, abs=0.01)
    assert "its images are stamped 0.1" in ctx.warnings[0]
    assert out.metrics.values["camera"]["delay_beside_s"] == pytest.approx(0.15, abs=0.01)


def test_true_poses_that_are_late_are_not_taken_for_early_images() -> None:
    odometry, late = ([Pose(*pose) for pose in swinging(STAMPS - by).tolist()] for by in (0.0, 0.15))
    for measured, delay in ((odometry, 0.0), ([None] * len(TICKS), -0.15)):
        _, out = learned(
            swinging(STAMPS - 0.15), "truth", seen_along(swinging(STAMPS)),
            camera=CAMERA, ticks=TICKS, odometry=measured, truth=late,
        )  # fmt: skip
        assert out.map.landmarks.delay_s == pytest.approx(delay, abs=0.01)


def test_the_images_of_several_logs_and_of_a_way_with_gaps_are_taken_to_be_in_time() -> None:
    features, robot = seen_along(swinging(STAMPS - 0.15)), [Pose(*pose) for pose in swinging(STAMPS).tolist()]
    two_logs = [replace(tick, log=int(tick.index > 25)) for tick in TICKS]
    for way, times in ((robot, two_logs), ([None, *robot[1:]], TICKS), (robot[1:], TICKS)):
        _, out = learned(swinging(STAMPS), "truth", features, camera=CAMERA, ticks=times, truth=way)
        assert out.map.landmarks.delay_s == 0.0


def test_a_mount_that_is_described_is_believed_and_nothing_is_said() -> None:
    poses, mount = tour_poses(), np.array([0.5, -0.2, 0.0])
    camera = replace(CAMERA, position_x=0.5, position_y=-0.2)
    ctx, out = learned(robot_poses(poses, mount), "truth", seen_along(poses), camera=camera)
    assert not ctx.warnings
    assert not out.map.landmarks.camera
    assert (out.map.landmarks.mount == mount).all()
    gap, _ = KDTree(room().where - (0.0, 0.0, HEIGHT_M)).query(out.map.landmarks.points)
    assert np.median(gap) < 0.001


def test_a_camera_that_is_as_it_is_described_is_mounted_so_to_the_last_bit() -> None:
    poses, camera = tour_poses(), replace(CAMERA, yaw=0.3)
    _, out = learned(poses, "truth", seen_along(poses), camera=camera)
    assert not out.map.landmarks.mounted(camera.mount, True).any()


def test_motion_that_was_seen_in_the_images_tells_no_mount() -> None:
    poses = tour_poses()
    _, out = learned(robot_poses(poses, np.array([0.5, 0.0, 0.0])), "guess", seen_along(poses), camera=CAMERA)
    assert not out.map.landmarks.mount.any()

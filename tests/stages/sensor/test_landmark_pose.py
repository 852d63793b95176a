import math
from dataclasses import replace

import numpy as np
import pytest
from landmark_tour import graph_of, mapped_room, room, seen_from, tour_poses, with_landmarks
from made_tour import Landmarks as Points
from made_words import NOTHING, features_of

from omninav.pipeline import Context, Tick
from omninav.pipeline.graph.problems import BadInput
from omninav.stages.camera.equirectangular import Equirectangular
from omninav.stages.camera.hyperbolic import HyperbolicMirror
from omninav.stages.features.rotation_reduced_sift import RotationReducedSift
from omninav.stages.geometry.appearance.mirrored_patches import mirrored_sift
from omninav.stages.geometry.landmarks.bearing_pose import BearingPose
from omninav.stages.geometry.plane.mount import robot_covariances, robot_poses
from omninav.stages.geometry.plane.se2 import between, compose, wrap
from omninav.stages.sensor.landmark_pose import (
    LandmarkPose,
    LandmarkPoseState,
    covariance_of,
    log_odds_of,
    probabilities_of,
    sectors_of,
)
from omninav.stages.sensor.landmarks_shown import LandmarksShown
from omninav.stages.sensor.stamp_jitter import StampJitter
from omninav.stages.values.belief import Particles
from omninav.stages.values.image import Image
from omninav.stages.values.landmarks import LandmarkFix
from omninav.stages.values.length_scale import LengthScale
from omninav.stages.values.local_features import LocalFeatures
from omninav.stages.values.maps import ReferenceGraph
from omninav.stages.values.pose import AssumedMotion, Motion

FIRST = np.array([3.1, 2.9, 0.4])
AWAY = np.array([40.0, 0.0, 0.0])


def fix(
    features: LocalFeatures, map: ReferenceGraph | None = None, near: Particles | None = None, **parameters: int
) -> LandmarkFix | None:
    stage, ctx = LandmarkPose(**parameters), Context("landmark_pose")
    stage.setup(ctx)
    return stage.step(ctx, LandmarkPoseState(), features, map or mapped_room(), near).fix


def belief(*pose: float) -> Particles:
    rng = np.random.default_rng(0)
    return Particles(np.array(pose) + rng.normal(0.0, 0.1, (50, 3)), np.full(50, 0.02))


@pytest.mark.parametrize("near", [None, belief(3.0, 3.0, 0.4), belief(10.9, 0.5, -2.0)])
@pytest.mark.parametrize("pose", [(3.1, 2.9, 0.4), (5.3, 3.2, 3.1), (1.6, 2.2, -1.7)])
def test_the_pose_is_known_to_a_millimetre_whatever_is_believed(pose, near) -> None:
    found = fix(seen_from(room(), np.array(pose)), near=near)
    assert np.hypot(*(found.poses[0] - pose)[:2]) < 1e-3
    assert abs(wrap(found.poses[0, 2] - pose[2])) < math.radians(0.02)
    assert 12 <= found.inliers[0] <= found.matches
    assert np.argmax(found.probabilities) == 0
    assert 0.0 < found.probabilities.sum() <= 1.0
    assert np.sqrt(np.linalg.eigvalsh(found.covariances[0])).max() < 0.05


def test_where_words_say_nothing_the_belief_names_the_candidates() -> None:
    map = mapped_room()
    words = replace(map.landmarks.words, rarity=np.zeros_like(map.landmarks.words.rarity))
    wordless = replace(map, landmarks=replace(map.landmarks, words=words))
    features = seen_from(room(), FIRST)
    assert fix(features, wordless) is None
    assert fix(features, wordless, belief(10.5, 3.5, 0.0)) is None
    assert fix(features, wordless, belief(3.0, 2.8, 0.0)).poses[0] == pytest.approx(FIRST, abs=1e-3)


def test_where_the_first_references_show_no_pose_more_are_looked_at(monkeypatch: pytest.MonkeyPatch) -> None:
    features = seen_from(room(), FIRST)
    monkeypatch.setattr("omninav.stages.sensor.landmark_pose.WORD_REFERENCES", (0, 0))
    assert fix(features) is None
    monkeypatch.setattr("omninav.stages.sensor.landmark_pose.WORD_REFERENCES", (0, 80))
    assert fix(features).poses[0] == pytest.approx(FIRST, abs=1e-3)


def test_a_mirrored_image_and_one_of_another_room_have_no_pose() -> None:
    features = seen_from(room(), FIRST)
    assert fix(replace(features, bearings=features.bearings * [1.0, -1.0, 1.0])) is None
    looks = np.random.default_rng(1).integers(0, 100, features.descriptors.shape).astype(np.uint8)
    assert fix(replace(features, descriptors=looks)) is None


@pytest.mark.parametrize("mirrored", [False, True])
def test_landmarks_of_a_mirror_are_found_in_a_panorama_and_the_other_way_round(mirrored: bool) -> None:
    features, map = seen_from(room(), FIRST), mapped_room()
    seen = replace(features, descriptors=mirrored_sift(features.descriptors), mirrored=mirrored)
    known = replace(map, landmarks=replace(map.landmarks, mirrored=not mirrored))
    assert fix(seen, known).poses[0].tolist() == fix(features, map).poses[0].tolist()
    for unsaid in (mirrored, None):  # older maps do not say which they are of
        assert fix(seen, replace(map, landmarks=replace(map.landmarks, mirrored=unsaid))) is None


def test_two_places_that_look_the_same_are_rivals(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("omninav.stages.sensor.landmark_pose.WORD_REFERENCES", (30, 30))
    one = np.random.default_rng(2).uniform([0, 0, 0], [8, 6, 2.2], (500, 3))
    points = Points(np.concatenate([one, one + AWAY]), np.tile(np.arange(500), 2))
    points.looks[500::2] = np.random.default_rng(3).integers(0, 100, (250, 128))  # every other one differs
    poses = np.concatenate([tour_poses()[:20], tour_poses()[:20] + AWAY])
    map = with_landmarks(graph_of(poses), [seen_from(points, pose) for pose in poses])
    features = seen_from(points, FIRST)
    other = seen_from(points, FIRST + AWAY)
    half = np.arange(len(features)) % 2 == 0
    mixed = replace(features, descriptors=np.where(half[:, None], features.descriptors, other.descriptors))
    found = fix(mixed, map)
    assert len(found) == 2
    assert sorted(found.poses[:, 0]) == pytest.approx([FIRST[0], FIRST[0] + 40.0], abs=1e-2)
    assert found.inliers[0] >= found.inliers[1] >= 12
    assert [(found.agree == pose).sum() for pose in (0, 1)] == found.inliers.tolist()


def test_an_image_that_shows_too_little_says_nothing() -> None:
    features = seen_from(room(), FIRST)
    assert fix(NOTHING) is None
    assert fix(features.chosen(slice(0, 7))) is None
    assert fix(features, min_inliers=len(features) + 1) is None


def test_points_all_in_one_spot_or_two_or_all_alike_say_nothing() -> None:
    features = seen_from(room(), FIRST)
    odd = (np.arange(len(features)) % 2 == 1)[:, None]
    for bearings in ([1.0, 0.0, 0.0], [0.0, 0.0, 1.0], np.where(odd, [1.0, 0.0, 0.0], [0.0, 1.0, 0.0])):
        assert fix(replace(features, bearings=np.broadcast_to(bearings, (len(features), 3)).copy())) is None
    assert fix(replace(features, descriptors=np.full_like(features.descriptors, 7))) is None
    together = replace(
        mapped_room().landmarks, points=np.tile(np.float32([3, 2, 1]), (len(mapped_room().landmarks), 1))
    )
    assert fix(features, replace(mapped_room(), landmarks=together)) is None


def test_half_the_points_in_one_spot_do_not_move_the_pose() -> None:
    features = seen_from(room(), FIRST)
    bearings = features.bearings.copy()
    bearings[::2] = bearings[0]
    assert fix(replace(features, bearings=bearings)).poses[0] == pytest.approx(FIRST, abs=1e-3)


@pytest.mark.parametrize("level", [0, 255, (10, 90, 200)])
@pytest.mark.parametrize("size", [(64, 128), (4, 8)])
def test_images_of_one_colour_and_of_a_few_pixels_say_nothing(level, size) -> None:
    sift = RotationReducedSift(orientation="own", contrast=0.01, blur_px=1.0)
    sift.setup(Context("points"))
    image = Image(np.full((*size, 3), level, np.uint8))
    camera = Equirectangular.of_size(size[1], size[0])
    assert fix(sift.step(Context("points"), image, camera).features) is None


def test_a_map_without_landmarks_says_nothing() -> None:
    features, map = seen_from(room(), FIRST), graph_of(tour_poses()[:3])
    assert fix(features, map) is None
    assert fix(features, with_landmarks(map, [NOTHING] * 3), belief(*FIRST)) is None


def test_features_of_another_kind_than_the_maps_are_refused() -> None:
    short = features_of(np.ones((40, 64), np.uint8))
    with pytest.raises(BadInput, match="128 numbers, the image's have 64; use the features the map was learned with"):
        fix(short)


def test_references_that_a_map_has_learned_since_are_no_candidates() -> None:
    map = mapped_room()
    grown = replace(map, poses=np.concatenate([map.poses, [[3.0, 2.9, 0.0]]]), features=np.zeros((len(map) + 1, 12, 4)))
    assert fix(seen_from(room(), FIRST), grown, belief(*FIRST)).poses[0] == pytest.approx(FIRST, abs=1e-3)


def test_the_same_image_has_the_same_pose_to_the_last_bit() -> None:
    one, other = (fix(seen_from(room(), FIRST), near=belief(*FIRST)) for _ in range(2))
    assert one.poses.tobytes() == other.poses.tobytes()
    assert one.covariances.tobytes() == other.covariances.tobytes()


def test_it_is_known_which_features_agree_with_which_pose() -> None:
    features = seen_from(room(), FIRST)
    shuffled = features.bearings.copy()
    shuffled[::3] = np.roll(shuffled[::3], 5, axis=0)
    found = fix(replace(features, bearings=shuffled))
    assert len(found.bearings) == len(found.agree) == found.matches
    assert (found.agree == 0).sum() == found.inliers[0] < found.matches
    right = {row.tobytes() for row in features.bearings.astype(np.float32)}
    where = {row.tobytes(): n for n, row in enumerate(shuffled.astype(np.float32))}
    moved = np.array([where[row.tobytes()] % 3 == 0 for row in found.bearings])
    assert {row.tobytes() for row in found.bearings} <= right
    assert (found.agree[~moved] == 0).all()
    assert (found.agree[moved] == 0).mean() < 0.1


def test_a_map_that_was_saved_without_landmarks_is_said() -> None:
    ctx = Context("landmark_pose")
    for _ in range(2):
        assert (
            LandmarkPose().step(ctx, LandmarkPoseState(), seen_from(room(), FIRST), graph_of(tour_poses()[:3])).fix
            is None
        )
    (said,) = ctx.warnings
    assert "landmarks=sift, or type landmarks=none" in said
    LandmarkPose().step(ctx, LandmarkPoseState(), seen_from(room(), FIRST), mapped_room())
    assert len(ctx.warnings) == 1


def test_a_pose_is_the_likelier_the_more_sectors_of_the_view_its_landmarks_lie_in() -> None:
    azimuths = np.radians([1.0, 14.0, 16.0, -1.0, 164.0, 166.0])
    assert sectors_of(np.column_stack([np.cos(azimuths), np.sin(azimuths), 0 * azimuths])) == 5
    odds = np.exp([0.375, -0.375])  # 0.75 nats each sector, even at 7.5
    assert probabilities_of(log_odds_of(np.array([8, 7]))) == pytest.approx(odds / (1.0 + odds.sum()))
    assert probabilities_of(log_odds_of(np.array([24]))) == pytest.approx(1.0 / (1.0 + np.exp(-8.0)))


def test_a_pose_is_doubted_whose_place_shows_more_landmarks_unless_the_drive_never_shows_them() -> None:
    whole, map = seen_from(room(), FIRST), mapped_room()
    part = whole.chosen(np.arange(0, len(whole), 22))
    states = LandmarkPoseState(), LandmarkPoseState(shown=LandmarksShown(math.log(0.02)))
    lit, dark = (LandmarkPose().step(Context("landmark_pose"), state, part, map).fix for state in states)
    assert lit.inliers[0] == dark.inliers[0] < 0.1 * len(map.landmarks)
    assert lit.probabilities[0] < dark.probabilities[0] - 0.05
    assert states[0].shown.log_share < math.log(0.4)
    far = LandmarkPose().step(Context("landmark_pose"), LandmarkPoseState(), part, map, length_scale=LengthScale(0.01))
    assert far.fix.probabilities[0] == pytest.approx(dark.probabilities[0])  # so far from references none are expected


@pytest.mark.parametrize(("sigma", "larger"), [(0.01, 0.02), (0.03, 0.03)])
def test_the_variance_of_a_pose_is_that_of_bearings_by_map_or_image_and_never_below_a_floor(sigma, larger) -> None:
    pose = BearingPose(np.zeros(3), np.diag([1.0, 2.0, 0.0]), 0.02, np.ones(9, np.bool_), 0.0)
    expected = [4.0 * larger**2 + 9e-8, 8.0 * larger**2 + 9e-8, math.radians(0.003) ** 2]
    assert covariance_of(pose, sigma, 4.0) == pytest.approx(np.diag(expected))


def test_the_pose_is_that_of_the_robot_where_the_camera_sits_beside_its_axis() -> None:
    plain, mount = mapped_room(), np.array([0.4, -0.1, 0.2])
    described = Equirectangular(1024, 512, 512.0, elevation_top=1.5, elevation_bottom=-1.5, yaw=0.05)
    seen = seen_from(room(), FIRST)
    at = LandmarkPose().step(Context("landmark_pose"), LandmarkPoseState(), seen, plain).fix

    def of(camera: Equirectangular, **said: np.ndarray) -> LandmarkFix:
        map = replace(plain, landmarks=replace(plain.landmarks, **said))
        return LandmarkPose().step(Context("landmark_pose"), LandmarkPoseState(), seen, map, camera=camera).fix

    found = of(described, described=described.mount, mount=mount + np.array([0.0, 0.0, 0.05]))
    assert found.poses[0] == pytest.approx(robot_poses(at.poses[0], mount))
    assert found.covariances[0] == pytest.approx(robot_covariances(at.covariances, at.poses, mount)[0])
    assert found.inliers[0] == at.inliers[0]
    # A camera that is described otherwise than the tour's sits where its own description says.
    other = of(replace(described, position_x=0.3), described=described.mount, mount=mount)
    assert other.poses[0] == pytest.approx(robot_poses(at.poses[0], np.array([0.3, 0.0, 0.0])))


def test_the_pose_is_right_although_the_cameras_axis_is_beside_its_description_and_that_is_told_once() -> None:
    real = HyperbolicMirror(1280, 960, 994.0, 994.0, 639.5, 479.5, 28.095, 23.4125, 68.0, 476.0)
    described = replace(real, centre_x=645.5, centre_y=474.5)
    state, ctx, away = LandmarkPoseState(), Context("landmark_pose"), []
    for turn in np.linspace(0.0, 6.0, 40):
        pose = FIRST + np.array([0.3 * math.sin(turn), 0.3 * math.cos(turn), turn])
        features = seen_from(room(), pose)
        pixels, shown = real.project(features.bearings)
        features = replace(features, points=pixels, bearings=described.unproject(pixels)[0]).chosen(shown)
        poses = LandmarkPose().step(ctx, state, features, mapped_room(), camera=described).fix.poses
        away.append(math.hypot(*(poses[0] - pose)[:2]))
    assert max(away[-20:]) < 0.1 * away[0]
    before = state.axis
    for motion in (Motion(0.0, 0.005, 0.0), Motion(0.0, 0.0, 0.1)):
        LandmarkPose().step(ctx, state, features, mapped_room(), camera=described, motion=motion)
        assert (state.axis is before) == (motion.turn == 0.0)  # what stands shows nothing new
    assert state.axis.distance() == pytest.approx([-6.0, 5.0], abs=0.1)
    assert [each for each in ctx.warnings if "axis" in each] == [ctx.warnings[0]]
    assert "7.7 px beside where camera.yaml has it, at 639.5, 479.4" in ctx.warnings[0]


def test_the_pose_of_a_late_image_is_carried_on_by_its_part_of_the_last_motion() -> None:
    camera = Equirectangular(1024, 512, 512.0, elevation_top=1.5, elevation_bottom=-1.5, delay=0.1)

    def arc(turn: float) -> np.ndarray:
        return np.array([2.0 * math.sin(turn), 2.0 * (1.0 - math.cos(turn)), turn])

    plain, seen, motion = mapped_room(), seen_from(room(), FIRST), Motion(*arc(0.2))
    map = replace(plain, landmarks=replace(plain.landmarks, described_delay_s=0.1, delay_s=0.35))
    state, ctx = LandmarkPoseState(), Context("landmark_pose")

    def at(stamp: int, camera: Equirectangular = camera) -> np.ndarray:
        ctx.tick = Tick(1, stamp)
        return LandmarkPose().step(ctx, state, seen, map, camera=camera, motion=motion).fix.poses[0]

    assert at(0) == pytest.approx(FIRST, abs=1e-3)  # nothing tells the time of its motion
    assert at(10**9) == pytest.approx(compose(FIRST, arc(0.05)), abs=1e-3)
    assert at(3 * 10**9) == pytest.approx(compose(FIRST, arc(0.025)), abs=1e-3)
    assert at(4 * 10**9, replace(camera, delay=0.35)) == pytest.approx(FIRST, abs=1e-3)


def test_images_that_turn_later_than_odometry_are_found_late_and_their_poses_carried_on() -> None:
    camera = Equirectangular(1024, 512, 512.0, elevation_top=1.5, elevation_bottom=-1.5, delay=0.05)

    def at(second: float) -> np.ndarray:
        return FIRST + np.array([0.3 * math.sin(0.3 * second), 0.3 * math.cos(0.3 * second), math.sin(0.5 * second)])

    state, ctx, away, late = LandmarkPoseState(), Context("landmark_pose"), [], 0.2
    for number, second in enumerate(np.arange(0.5, 60.0, 0.5)):
        ctx.tick = Tick(number, int(second * 1e9), first_of_log=number == 0)
        x, y, turn = between(at(second - 0.5), at(second))
        found = LandmarkPose().step(
            ctx, state, seen_from(room(), at(second - late)), mapped_room(), camera=camera, motion=Motion(x, y, turn)
        )
        away.append(math.hypot(*(found.fix.poses[0] - at(second))[:2]))
    assert np.median(away[:40]) > 0.015
    assert np.median(away[-30:]) < 0.2 * np.median(away[:40])
    assert [each for each in ctx.warnings if "stamped" in each] == [ctx.warnings[0]]
    assert "+0.2" in ctx.warnings[0]
    assert float(ctx.warnings[0].split("`delay: ")[1].split("`")[0]) == pytest.approx(0.25, abs=0.03)
    before = state.late.rows
    ctx.tick = Tick(200, int(200e9))
    LandmarkPose().step(ctx, state, seen_from(room(), FIRST), mapped_room(), camera=camera)  # no motion is known
    assert len(before) > 100
    assert not len(state.late.rows)


@pytest.mark.parametrize(("seen", "probability"), [(False, 0.96), (False, 0.94), (True, 0.96)])
def test_covariances_allow_for_stamps_that_jitter_but_not_where_images_showed_the_motion(
    seen: bool, probability: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(StampJitter, "probability", lambda jitter: probability)
    camera = Equirectangular(1024, 512, 512.0, elevation_top=1.5, elevation_bottom=-1.5)
    state, ctx, rng, map = LandmarkPoseState(), Context("landmark_pose"), np.random.default_rng(1), mapped_room()
    late = rng.normal(0.0, 0.05, 30)
    for number, place in enumerate(0.1 * np.arange(30) + 0.5 * late):
        ctx.tick = Tick(number, 200_000_000 * (number + 1), first_of_log=number == 0)
        features = seen_from(room(), compose(FIRST, [place, 0.0, 0.0]))
        motion = AssumedMotion(0.1, 0.0, 0.0, 0.1, 0.1) if seen else Motion(0.1, 0.0, 0.0)
        found = LandmarkPose().step(ctx, state, features, map, camera=camera, motion=motion).fix
    ahead = np.array([math.cos(FIRST[2]), math.sin(FIRST[2]), 0.0])
    sigma = math.sqrt(ahead @ found.covariances[0] @ ahead)
    if seen:
        assert sigma < 0.003
        assert not ctx.warnings
        return
    assert 0.5 * 0.05 * 0.5 < sigma < 0.5 * 0.05 * 1.5
    aside = np.array([-ahead[1], ahead[0], 0.0])
    assert math.sqrt(aside @ found.covariances[0] @ aside) < 0.003
    assert ["ms off odometry" in warning for warning in ctx.warnings] == [True] * (probability > 0.95)
    ctx.tick = Tick(30, 0, log=1, first_of_log=True)
    LandmarkPose().step(ctx, state, features, map, camera=camera, motion=Motion(0.1, 0.0, 0.0))
    assert not state.told
    assert not state.jitter.hypotheses.any()

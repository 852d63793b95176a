"""What leaves the system is as wide as errors are, and as wide as the map where the estimate is probably wrong."""

import math
from dataclasses import replace

import numpy as np
import pytest
from landmark_tour import graph_of, mapped_room

import omninav
from omninav.pipeline import Context, Tick
from omninav.stages.monitor.widened_covariance import WidenCovariance, WidenCovarianceState
from omninav.stages.values.belief import PoseEstimate
from omninav.stages.values.commands import Reinitialise
from omninav.stages.values.confidence import PoseConfidence
from omninav.stages.values.landmarks import LandmarkFix
from omninav.stages.values.length_scale import LengthScale
from omninav.stages.values.pose import Motion, Pose
from omninav.stages.values.track import Track

MAP = graph_of(np.column_stack([np.linspace(-10.0, 10.0, 41), np.zeros((41, 2))]))
OWN = np.diag((0.01, 0.02, 0.003))
POSE = Pose(10.0, 0.0, 0.0)


def widened(of_mode: float, length_scale: float = 0.5, floor: float = 0.4) -> PoseEstimate:
    estimate = PoseEstimate(POSE, OWN, 0.9, POSE)
    told = PoseConfidence(0.4 * of_mode, of_mode=of_mode)  # of a mode that is wider than the tolerance
    stage, state = WidenCovariance(floor=floor), WidenCovarianceState()
    return stage.step(Context("wide"), estimate, told, LengthScale(length_scale), MAP, state).estimate


def test_a_share_of_the_length_scale_is_added_to_the_position_alone():
    found = widened(0.9)
    assert found.covariance == pytest.approx(OWN + np.diag((0.04, 0.04, 0.0)))
    assert (found.pose, found.mode_weight) == (POSE, 0.9)
    assert widened(0.9, floor=0.0).covariance == pytest.approx(OWN)


def test_an_estimate_that_is_more_probably_wrong_than_right_may_be_anywhere_in_the_map():
    found = widened(0.49).covariance
    far = np.array([-20.0, 0.0])
    assert math.sqrt(found[0, 0]) == pytest.approx(11.6, abs=0.1)  # 5.9 m about the middle, which is 10 m away
    assert far @ np.linalg.inv(found[:2, :2]) @ far < 5.991  # the map's other end is within the 95 % ellipse
    assert found[2, 2] == pytest.approx(0.003 + math.pi**2 / 3.0)  # of any heading
    assert widened(0.51).covariance[0, 0] < 0.1


def test_an_estimate_that_is_off_by_less_than_a_length_scale_is_within_the_95_percent_ellipse():
    errors = np.random.default_rng(0).normal(
        0.0, 0.4, (1000, 2)
    )  # length scales, as where the drive is beside the tour
    covariance = widened(0.9, length_scale=1.0).covariance[:2, :2]
    squares = (errors @ np.linalg.inv(covariance) * errors).sum(axis=1)
    assert 0.9 < (squares <= 5.991).mean() < 0.98


@pytest.mark.parametrize("variant", ["omninav", "omniview_mcl", "retrieval_mcl", "retrieval_mcl_as_printed"])
def test_what_is_published_drawn_and_measured_is_the_widened_estimate(variant):
    wires = omninav.compose(variant, "publish=ros2").settings["wires"]
    own = {node for node, ports in wires.items() if "belief_estimate." in str(ports)}
    assert own - {"conflicts", "evidence"} == {"estimate", "monitor"}
    taken = {node for node, ports in wires.items() if "'estimate.estimate'" in str(ports)}
    assert {"publish", "shown", "drive"} <= taken


def test_a_pose_by_landmarks_keeps_its_own_covariance_until_odometry_has_drifted():
    stage, state, told = WidenCovariance(), WidenCovarianceState(), PoseConfidence(0.9)
    estimate = PoseEstimate(POSE, 1e-4 * np.eye(3), 0.9, POSE)
    # Less and more than four standard deviations away, of both together.
    there, away = (np.array([[POSE.x + off, POSE.y, POSE.heading + math.tau]]) for off in (0.056, 0.057))

    def variance(poses: np.ndarray | None, probability: float, metres: float, first: bool = False) -> float:
        fix = None
        if poses is not None:
            fix = LandmarkFix(poses, 1e-4 * np.eye(3)[None], np.array([50]), np.array([probability]), 60)
        ctx, motion = Context("wide"), Motion(0.6 * metres, 0.8 * metres, 0.0)
        ctx.tick = Tick(0, 0, first_of_log=first)
        out = stage.step(ctx, estimate, told, LengthScale(0.5), MAP, state, fix, motion)
        return float(out.estimate.covariance[0, 0])

    assert variance(None, 0.0, 0.2) == pytest.approx(1e-4 + 0.09)  # no landmarks yet: the whole share
    assert variance(away, 0.99, 0.2) == pytest.approx(1e-4 + 0.09)  # landmarks that say another pose
    assert variance(there, 0.89, 0.2) == pytest.approx(1e-4 + 0.09)  # too few to be sure of
    assert variance(there, 0.91, 0.2) == pytest.approx(1e-4)
    assert [variance(None, 0.0, 0.2) for _ in range(5)][-1] == pytest.approx(1e-4 + 0.01 + 0.0025)
    assert variance(None, 0.0, 0.0, first=True) == pytest.approx(1e-4 + 0.09)
    assert variance(there, 0.99, 0.0) == pytest.approx(1e-4)
    assert [variance(None, 0.0, 0.5) for _ in range(20)][-1] == pytest.approx(1e-4 + 0.09)


ON = {"x": 0.2, "turn": 0.2}


@pytest.mark.parametrize(
    ("then", "share"),
    [
        (ON, False),
        (ON | {"x": 1.0}, False),
        (ON | {"x": 1.1}, True),
        (ON | {"turn": 0.4}, True),
        (ON | {"track": Track(True)}, False),
        (ON | {"track": Track(True, carried=True)}, True),
        (ON | {"restart": Reinitialise()}, True),
    ],
)
def test_where_the_estimate_does_not_go_on_from_a_pose_by_landmarks_the_way_since_says_nothing(then, share):
    stage, state = WidenCovariance(), WidenCovarianceState()

    def variance(x, turn=0.1, fix=None, **ports):
        pose = Pose(x, 0.0, 3.0 + turn)
        estimate, step = PoseEstimate(pose, 1e-4 * np.eye(3), 0.9, pose), Motion(-0.2, 0.0, 0.1)
        told = (PoseConfidence(0.9), LengthScale(0.8), MAP, state, fix, step)
        return stage.step(Context("wide"), estimate, *told, **ports).estimate.covariance[0, 0]

    sure = LandmarkFix(np.array([[0.0, 0.0, 3.1]]), 1e-4 * np.eye(3)[None], np.array([50]), np.array([0.95]), 60)
    assert variance(0.0, fix=sure) == pytest.approx(1e-4)
    assert variance(**then) == pytest.approx(1e-4 + (0.48**2 if share else 0.01 * 0.2 + 0.0001))
    assert (variance(0.4, turn=0.3) > 0.1) == share  # nor is it sure again at the next image


def test_the_nearest_references_own_errors_are_added_where_the_map_knows_them():
    room = mapped_room()
    sigmas = np.linspace(0.01, 0.4, len(room))[:, None] * [1.0, 2.0, 0.5]
    bent = replace(room, landmarks=replace(room.landmarks, pose_sigmas=sigmas))
    x, y, _ = room.poses[7] + [0.02, 0.01, 0.0]
    estimate = PoseEstimate(Pose(x, y, 0.0), OWN, 0.9, POSE)
    stage, told = WidenCovariance(floor=0.0), PoseConfidence(0.9)

    def covariance(map):
        return stage.step(Context("wide"), estimate, told, LengthScale(0.5), map, WidenCovarianceState()).estimate

    few = replace(room.landmarks.of_references(np.arange(5)), pose_sigmas=sigmas[:5])
    nearest = np.argmin(np.hypot(*(room.poses[:5, :2] - [x, y]).T))
    learned_since = replace(room, landmarks=few)
    assert covariance(learned_since).covariance == pytest.approx(OWN + np.diag(sigmas[nearest] ** 2))
    unknown = replace(room, landmarks=replace(room.landmarks, pose_sigmas=None))
    assert covariance(unknown).covariance == pytest.approx(OWN)
    assert covariance(bent).covariance == pytest.approx(OWN + np.diag(sigmas[7] ** 2))

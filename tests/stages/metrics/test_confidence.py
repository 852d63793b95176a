"""What a run says of itself without ground truth."""

import dataclasses
import math

import numpy as np
import pytest
from small_run import collected

from omninav.pipeline import Context, Tick
from omninav.stages.metrics.confidence import Confidence, confident
from omninav.stages.metrics.frames_table import columns_of
from omninav.stages.values.belief import PoseEstimate, SinglePose
from omninav.stages.values.drive import Drive
from omninav.stages.values.pose import Motion, Pose
from omninav.stages.values.similarity import BestMatch


def estimate(x: float, sigma: float, weight: float) -> PoseEstimate:
    pose = Pose(x, 0.0, 0.0)
    return PoseEstimate(pose, np.diag([0.01, sigma**2, 0.1]), weight, pose)


def drive(truth: Pose | None = None) -> Drive:
    """Four frames a metre apart by odometry; the third estimate jumps by two metres, the fourth lacks."""
    estimates = [estimate(0.0, 2.0, 0.9), estimate(1.0, 0.5, 0.4), estimate(4.0, 0.5, 0.8), None]
    return collected(
        [Tick(n, n * 10**9) for n in range(4)],
        [truth] * 4,
        estimates=estimates,
        motion=[None, *[Motion(1.0, 0.0, 0.0)] * 3],
        matches=[BestMatch(0, 0.0, similarity=s) for s in (0.9, 0.8, 0.7)] + [None],
    )


def test_an_estimate_is_confident_where_it_is_heavy_and_narrow():
    assert confident(drive()).tolist() == [False, False, True, False]
    assert columns_of(drive())["confident"].tolist() == [0, 0, 1, -1]


def test_figures_of_a_run_without_truth():
    metrics = Confidence().step(Context("confidence"), drive()).metrics
    values = metrics.values["confidence"]
    assert values["confident_share"] == 0.25
    assert values["first_confident_frame"] == 2
    assert values["spread_m"] == pytest.approx(0.5)
    assert values["weight"] == pytest.approx(0.8)
    assert (values["path_m"], values["odometry_path_m"]) == pytest.approx((4.0, 3.0))
    assert values["step_off_odometry_m"] == pytest.approx(1.0)  # of 0 and 2 m
    assert values["turn_off_odometry_deg"] == pytest.approx(0.0)
    assert values["similarity"] == pytest.approx(0.8)
    assert values["similarity_p10"] == pytest.approx(0.72)


def test_a_stated_confidence_is_told_where_there_is_one():
    assert "probability" not in Confidence().step(Context("confidence"), drive()).metrics.values["confidence"]
    stated = dataclasses.replace(drive(), confidence=np.array([0.2, 0.9, 0.6, np.nan]))
    values = Confidence().step(Context("confidence"), stated).metrics.values["confidence"]
    assert (values["probability"], values["doubtful_share"]) == pytest.approx((0.6, 1 / 3))


def test_where_there_is_truth_errors_say_more():
    assert Confidence().step(Context("confidence"), drive(Pose(0.0, 0.0, 0.0))).metrics is None


def test_a_belief_that_is_always_one_pose_says_nothing_of_confidence():
    single = SinglePose(Pose(1.0, 2.0, math.pi)).estimate()
    run = collected([Tick(0, 0), Tick(1, 1)], [None] * 2, estimates=[single] * 2)
    values = Confidence().step(Context("confidence"), run).metrics.values["confidence"]
    assert values == {"path_m": 0.0}


@pytest.mark.parametrize(
    ("weight", "sigma", "sure"), [(0.5, 1.0, True), (0.49, 1.0, False), (0.5, 1.01, False), (1.0, 0.1, True)]
)
def test_half_of_the_belief_within_a_metre_is_confident(weight: float, sigma: float, sure: bool):
    run = collected([Tick(0, 0)], [None], estimates=[estimate(0.0, sigma, weight)])
    assert confident(run).tolist() == [sure]
    found = Confidence().step(Context("confidence"), run).metrics
    assert found.values["confidence"]["first_confident_frame"] == (0 if sure else None)
    assert found.values["confidence"]["spread_m"] == pytest.approx(max(sigma, 0.1))
    assert found.headlines == ("confidence.confident_share", "confidence.spread_m")


def test_a_belief_of_two_poses_is_told_by_its_weight_and_one_with_a_spread_by_that():
    narrow = PoseEstimate(Pose(0.0, 0.0, 0.0), np.zeros((3, 3)), 0.8, Pose(0.0, 0.0, 0.0))
    values = Confidence().step(Context("c"), collected([Tick(0, 0)], [None], estimates=[narrow])).metrics.values
    assert values["confidence"]["weight"] == 0.8
    assert "spread_m" not in values["confidence"]
    wide = collected([Tick(0, 0)], [None], estimates=[estimate(0.0, 0.5, 1.0)])
    assert Confidence().step(Context("c"), wide).metrics.values["confidence"]["spread_m"] == pytest.approx(0.5)


def test_the_last_log_counts_and_its_estimates_against_odometry_s_turns():
    poses = [Pose(9.0, 9.0, 1.0), Pose(0.0, 0.0, 0.0), Pose(0.0, 2.0, 0.5), Pose(0.0, 3.0, 1.0), Pose(1.0, 3.0, 3.0)]
    estimates = [PoseEstimate(pose, np.diag([0.04, 0.01, 0.1]), 0.9, pose) for pose in poses]
    ticks = [Tick(n, n, int(n > 0), max(n - 1, 0)) for n in range(5)]
    motion = [None, None, Motion(0.0, 1.0, 0.3), Motion(0.0, 0.0, 0.0), Motion(0.0, 0.0, 0.5)]
    run = dataclasses.replace(
        collected(ticks, [None] * 5, motion, estimates), confidence=np.array([0.1, 0.5, 0.4, 0.6, 0.9])
    )
    values = Confidence().step(Context("confidence"), run).metrics.values["confidence"]
    assert (values["path_m"], values["odometry_path_m"]) == pytest.approx((4.0, 1.0))
    assert values["step_off_odometry_m"] == pytest.approx(1.0)  # 1, 1, 1
    assert values["turn_off_odometry_deg"] == pytest.approx(math.degrees(0.5))  # 0.2, 0.5, 1.5
    assert (values["probability"], values["doubtful_share"]) == pytest.approx((0.55, 0.25))
    assert (values["confident_share"], values["first_confident_frame"]) == (1.0, 0)


def test_one_estimate_has_no_motion_to_compare():
    run = collected(
        [Tick(0, 0), Tick(1, 1)], [None] * 2, [None, Motion(3.0, 4.0, 0.0)], [None, estimate(0.0, 0.5, 0.9)]
    )
    values = Confidence().step(Context("confidence"), run).metrics.values["confidence"]
    assert values["odometry_path_m"] == 5.0
    assert "step_off_odometry_m" not in values
    two = collected(
        [Tick(0, 0), Tick(1, 1)], [None] * 2, [None, Motion(3.0, 4.0, 0.0)], [estimate(x, 0.5, 0.9) for x in (0.0, 3.0)]
    )
    assert Confidence().step(Context("c"), two).metrics.values["confidence"]["step_off_odometry_m"] == pytest.approx(
        4.0
    )


def test_where_one_frame_has_doubt_the_run_has_and_its_spread_is_told():
    def frame(sigma: float, weight: float, x: float = 0.0) -> PoseEstimate:
        pose = Pose(x, 0.0, 2.0 * x)
        return PoseEstimate(pose, np.diag([sigma**2, 0.0, 0.0]), weight, pose)

    for frames in ([frame(0.0, 1.0), frame(0.0, 0.9)], [frame(0.0, 1.0), frame(0.5, 1.0)]):
        run = collected([Tick(n, n) for n in range(2)], [None] * 2, estimates=frames)
        values = Confidence().step(Context("c"), run).metrics.values["confidence"]
        assert values["weight"] == pytest.approx(np.median([each.mode_weight for each in frames]))
        assert ("spread_m" in values) == (frames[1].covariance[0, 0] > 0.0)


def test_ways_are_in_the_plane_and_medians_are_told():
    poses = [Pose(x, 0.0, x) for x in (0.0, 1.0, 2.0, 9.0)]
    estimates = [PoseEstimate(pose, np.eye(3) * 0.01, 0.9, pose) for pose in poses]
    motion = [None, *[Motion(0.0, 0.0, 0.0)] * 2, Motion(3.0, 4.0, 1.0)]
    matches = [BestMatch(0, 0.0, similarity=similarity) for similarity in (0.1, 0.2, 0.4, 1.0)]
    run = collected([Tick(n, n) for n in range(4)], [None] * 4, motion, estimates, None, matches)
    values = Confidence().step(Context("c"), run).metrics.values["confidence"]
    assert (values["path_m"], values["odometry_path_m"]) == (9.0, 5.0)
    assert values["step_off_odometry_m"] == 1.0
    assert values["similarity"] == pytest.approx(0.3)

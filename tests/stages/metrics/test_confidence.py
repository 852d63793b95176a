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

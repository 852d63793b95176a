"""What a run says of itself without ground truth."""

import dataclasses
import math

import numpy as np
import pytest
from measured_drives import AT_ORIGIN, figures, made_drive

from omninav.pipeline import Context
from omninav.stages.metrics.confidence import Confidence, confident
from omninav.stages.values.belief import PoseEstimate, SinglePose
from omninav.stages.values.drive import Drive
from omninav.stages.values.pose import Pose
from omninav.stages.values.similarity import BestMatch


def estimate(x: float, sigma: float, weight: float, y: float = 0.0, heading: float = 0.0) -> PoseEstimate:
    pose = Pose(x, y, heading)
    return PoseEstimate(pose, np.diag([0.01, sigma**2, 0.1]), weight, pose)


def blind(estimates: list[PoseEstimate | None], motion=None, **given) -> Drive:
    """A drive without truth."""
    return made_drive([None] * len(estimates), motion=motion, estimates=estimates, **given)


def told(drive: Drive) -> dict:
    return figures(Confidence(), drive)["confidence"]


SEEN = [estimate(0.0, 2.0, 0.9), estimate(1.0, 0.5, 0.4), estimate(4.0, 0.5, 0.8), None]
METRE_BY_METRE = [None, *[(1.0, 0.0, 0.0)] * 3]
DRIVE = blind(SEEN, METRE_BY_METRE, matches=[BestMatch(0, 0.0, similarity=s) for s in (0.9, 0.8, 0.5)] + [None])
"""Four frames a metre apart by odometry; the third estimate jumps by two metres, the fourth lacks."""


def test_figures_of_a_run_without_truth():
    assert told(DRIVE) == pytest.approx(
        {
            "confident_share": 0.25,
            "first_confident_frame": 2,
            "spread_m": 0.5,
            "weight": 0.8,
            "path_m": 4.0,
            "odometry_path_m": 3.0,
            "step_off_odometry_m": 1.0,  # of 0 and 2 m
            "turn_off_odometry_deg": 0.0,
            "similarity": 0.8,
            "similarity_p10": 0.56,
        }
    )


def test_a_stated_confidence_is_told_where_there_is_one():
    values = told(dataclasses.replace(DRIVE, confidence=np.array([0.2, 0.9, 0.6, np.nan])))
    assert (values["probability"], values["doubtful_share"]) == pytest.approx((0.6, 1 / 3))


def test_where_there_is_truth_errors_say_more():
    assert figures(Confidence(), made_drive([AT_ORIGIN] * 4, estimates=SEEN)) is None


def test_a_belief_that_is_always_one_pose_says_nothing_of_confidence():
    assert told(blind([SinglePose(Pose(1.0, 2.0, math.pi)).estimate()] * 2)) == {"path_m": 0.0}


@pytest.mark.parametrize(
    ("weight", "sigma", "sure"), [(0.5, 1.0, True), (0.49, 1.0, False), (0.5, 1.01, False), (1.0, 0.1, True)]
)
def test_half_of_the_belief_within_a_metre_is_confident(weight: float, sigma: float, sure: bool):
    run = blind([estimate(0.0, sigma, weight)])
    assert confident(run).tolist() == [sure]
    found = Confidence().step(Context("confidence"), run).metrics
    assert found.values["confidence"]["first_confident_frame"] == (0 if sure else None)
    assert found.values["confidence"]["spread_m"] == pytest.approx(max(sigma, 0.1))
    assert found.headlines == ("confidence.confident_share", "confidence.spread_m")


def test_the_last_log_counts_and_its_estimates_against_odometry_s_turns():
    poses = [(9.0, 9.0, 1.0), (0.0, 0.0, 0.0), (0.0, 2.0, 0.5), (0.0, 3.5, 1.0), (1.0, 3.5, 3.0)]
    estimates = [estimate(x, 0.1, 0.9, y, heading) for x, y, heading in poses]
    motion = [None, None, (0.0, 1.0, 0.3), AT_ORIGIN, (0.0, 0.0, 0.5)]
    run = blind(estimates, motion, logs=[0, 1, 1, 1, 1])
    values = told(dataclasses.replace(run, confidence=np.array([0.1, 0.5, 0.4, 0.6, 0.9])))
    assert (values["path_m"], values["odometry_path_m"]) == pytest.approx((4.5, 1.0))
    assert values["step_off_odometry_m"] == pytest.approx(1.0)  # 1, 1.5, 1
    assert values["turn_off_odometry_deg"] == pytest.approx(math.degrees(0.5))  # 0.2, 0.5, 1.5
    assert (values["probability"], values["doubtful_share"]) == pytest.approx((0.55, 0.25))
    assert (values["confident_share"], values["first_confident_frame"]) == (1.0, 0)


@pytest.mark.parametrize(("heading", "step", "confidence", "warned"), [
    (0.0, 1.0, 0.9, False), (3.1, 1.0, 0.9, True), (0.2, 1.0, 0.9, False), (3.1, 1.0, 0.4, False),
    (0.0, 2.5, 0.9, True),
])  # fmt: skip
def test_a_sure_estimate_that_jumps_against_odometry_is_warned_of(
    heading: float, step: float, confidence: float, warned: bool
):
    estimates = [estimate(step * n, 0.1, 0.9, 0.0, heading * (n % 2)) for n in range(4)]
    ctx = Context("confidence")
    Confidence().step(ctx, dataclasses.replace(blind(estimates, METRE_BY_METRE), confidence=np.full(4, confidence)))
    assert [("moves by" in warning) for warning in ctx.warnings] == [True] * warned


def test_one_estimate_has_no_motion_to_compare():
    motion, last = [None, (3.0, 4.0, 0.0)], estimate(3.0, 0.5, 0.9)
    values = told(blind([None, last], motion))
    assert values["odometry_path_m"] == 5.0
    assert "step_off_odometry_m" not in values
    assert told(blind([estimate(0.0, 0.5, 0.9), last], motion))["step_off_odometry_m"] == pytest.approx(4.0)


@pytest.mark.parametrize(("sigma", "weight", "median"), [(0.0, 0.9, 0.95), (0.5, 1.0, 1.0)])
def test_where_one_frame_has_doubt_the_run_has_and_its_spread_is_told(sigma, weight, median):
    covariances, pose = (np.zeros((3, 3)), np.diag([sigma**2, 0.0, 0.0])), Pose(*AT_ORIGIN)
    frames = zip(covariances, (1.0, weight), strict=True)
    values = told(blind([PoseEstimate(pose, covariance, share, pose) for covariance, share in frames]))
    assert values["weight"] == pytest.approx(median)
    assert ("spread_m" in values) == (sigma > 0.0)

import math

import numpy as np
import pytest

from omninav.pipeline import Context
from omninav.stages.fusion.pose_estimate import BeliefEstimate
from omninav.stages.values.belief import GaussianMixture

BELIEF = GaussianMixture(
    np.array([[0.0, 0.0, 0.0], [4.0, 8.0, math.pi / 2]]), np.stack([np.eye(3)] * 2), np.array([0.75, 0.25])
)


def test_the_pose_that_is_told_is_the_heaviest_mode_unless_the_mean_is_asked_for():
    mode = BeliefEstimate().step(Context("estimate"), BELIEF).estimate
    mean = BeliefEstimate(taken="mean").step(Context("estimate"), BELIEF).estimate
    assert (mode.pose.x, mode.pose.y, mode.pose.heading) == (0.0, 0.0, 0.0)
    assert (mean.pose.x, mean.pose.y) == pytest.approx((1.0, 2.0))
    assert mean.pose == mean.mean
    assert mean.mode_weight == mode.mode_weight == 0.75

import math

import numpy as np
import pytest

from omninav.pipeline import Context
from omninav.stages.fusion.pose_estimate import BeliefEstimate
from omninav.stages.values.belief import GaussianMixture, Particles
from omninav.stages.values.length_scale import LengthScale

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


@pytest.mark.parametrize(
    ("stage", "metres", "x"),
    [
        (BeliefEstimate(), 0.06, 0.3),
        (BeliefEstimate(mode_radius=2.0), 0.06, 0.6),
        (BeliefEstimate(mode_radius=2.0), 0.5, 0.3),
        (BeliefEstimate(mode_radius_deg=5.0), 0.5, 0.6),
    ],
)
def test_a_mode_is_as_wide_as_is_asked_in_the_maps_length_scale(stage: BeliefEstimate, metres: float, x: float) -> None:
    # Nearly half of the weight is at 0, turned by 10 degrees; the rest is 0.6 m away.
    belief = Particles(np.array([[0.0, 0.0, math.radians(10.0)], [0.6, 0.0, 0.0]]), np.array([0.4999, 0.5001]))
    found = stage.step(Context("estimate"), belief, LengthScale(metres)).estimate
    assert found.pose.x == pytest.approx(x, abs=1e-3)

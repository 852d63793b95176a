"""The pose that stands for a belief."""

import numpy as np
import pytest

from omninav.pipeline import Context
from omninav.stages.metrics.pose_estimate import BeliefEstimate
from omninav.stages.values.belief import Particles

POSES = np.concatenate([np.tile([1.0, 0.0, 0.0], (60, 1)), np.tile([9.0, 0.0, 0.0], (40, 1))])
SPLIT = Particles(POSES, np.full(100, 0.01))


@pytest.mark.parametrize(("taken", "x"), [("mode", 1.0), ("mean", 4.2)])
def test_a_split_belief_is_its_heavier_mode_or_its_mean(taken, x):
    estimate = BeliefEstimate(taken=taken).step(Context("estimate"), SPLIT).estimate
    assert estimate.pose.x == pytest.approx(x)
    assert (estimate.mean.x, estimate.mode_weight) == (pytest.approx(4.2), pytest.approx(0.6))

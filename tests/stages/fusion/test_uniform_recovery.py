"""Bootstrap resampling with random samples (Wolf, Burgard & Burkhardt 2005, section VI-C: 50 of 5000)."""

import numpy as np
from made_beliefs import even, scattered_around

from omninav.pipeline import Context
from omninav.stages.fusion.uniform_recovery import UniformRecovery
from omninav.stages.values.belief import Likelihood, Particles
from omninav.stages.values.grid import FreeSpace

AREA = FreeSpace(np.array([[50.5, 50.5], [51.5, 50.5]]), 1.0)


def belief(number: int) -> Particles:
    return scattered_around(0.0, 1.0, number)


def anywhere() -> Particles:
    return even(AREA.draw(np.random.default_rng(0), 100))


def fused(number: int, proposals: Particles, values: np.ndarray | None = None) -> Particles:
    likelihood = Likelihood(np.ones(number) if values is None else values)
    ctx = Context("fusion", np.random.default_rng(0))
    return UniformRecovery(number=number).step(ctx, belief(number), likelihood, proposals).belief


def test_random_samples_replace_as_many_resampled_ones_and_weigh_alike():
    out = fused(5000, anywhere())
    assert len(out.poses) == UniformRecovery().number == 5000
    assert np.allclose(out.weights, 1 / 5000)
    fresh = out.poses[:, 0] > 40
    assert fresh.sum() == 50
    assert (out.poses[fresh, 0] >= 50).all()
    assert (out.poses[fresh, 0] < 52).all()
    assert len(np.unique(out.poses[fresh, 0])) == 50


def test_proposals_are_drawn_by_their_weights():
    two = Particles(np.array([[60.0, 0, 0], [70.0, 0, 0]]), np.array([0.1, 0.9]))
    out = fused(5000, two)
    assert [(out.poses[:, 0] == x).sum() for x in (60.0, 70.0)] == [5, 45]


def test_all_samples_may_be_random():
    out = fused(40, anywhere())
    assert len(out.poses) == 40
    assert (out.poses[:, 0] > 40).all()

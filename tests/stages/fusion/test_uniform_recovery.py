"""Bootstrap resampling with random samples (Wolf, Burgard & Burkhardt 2005, section VI-C: 50 of 5000)."""

import numpy as np
import pytest
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


def fuse(stage: UniformRecovery, particles: Particles, values: np.ndarray, proposals: Particles | None, seed: int = 0):
    ctx = Context("fusion", np.random.default_rng(seed))
    return stage.step(ctx, particles, Likelihood(values), proposals).belief, ctx


def test_random_samples_replace_as_many_resampled_ones_and_weigh_alike():
    out, _ = fuse(UniformRecovery(), belief(5000), np.ones(5000), anywhere())
    assert len(out.poses) == 5000
    assert np.allclose(out.weights, 1 / 5000)
    fresh = out.poses[:, 0] > 40
    assert fresh.sum() == 50
    assert (out.poses[fresh, 0] >= 50).all()
    assert (out.poses[fresh, 0] < 52).all()
    assert len(np.unique(out.poses[fresh, 0])) == 50


def test_without_proposals_all_are_drawn_by_weight_times_likelihood():
    # A Gaussian times a Gaussian likelihood: the posterior mean is worked by hand, (0 + 0.5 / 0.1^2) / (1 + 1 / 0.1^2).
    particles = belief(50_000)
    values = np.exp(-0.5 * ((particles.poses[:, 0] - 0.5) / 0.1) ** 2)
    out, _ = fuse(UniformRecovery(), particles, values, None)
    assert len(out.poses) == 5000
    assert (out.poses[:, 0] < 40).all()
    assert out.poses[:, 0].mean() == pytest.approx(50 / 101, abs=0.01)
    assert out.poses[:, 0].std() == pytest.approx((1 / 101) ** 0.5, rel=0.1)


@pytest.mark.parametrize("values", [np.zeros(1000), np.full(1000, np.nan), np.full(1000, np.inf)])
def test_a_view_that_nothing_explains_is_passed_over_and_told_of(values: np.ndarray):
    out, ctx = fuse(UniformRecovery(number=1000), belief(1000), values, None)
    assert np.allclose(np.sort(out.poses[:, 0]), np.sort(belief(1000).poses[:, 0]))
    assert ctx.counts["belief_without_support"] == 1


def test_the_same_seed_gives_the_same_samples():
    one, other = (
        fuse(UniformRecovery(), belief(5000), np.linspace(0, 1, 5000), anywhere(), seed=4)[0] for _ in range(2)
    )
    assert np.array_equal(one.poses, other.poses)


def test_proposals_are_drawn_by_their_weights():
    two = Particles(np.array([[60.0, 0, 0], [70.0, 0, 0]]), np.array([0.1, 0.9]))
    out, _ = fuse(UniformRecovery(), belief(5000), np.ones(5000), two)
    assert [(out.poses[:, 0] == x).sum() for x in (60.0, 70.0)] == [5, 45]


def test_all_samples_may_be_random():
    out, _ = fuse(UniformRecovery(number=40), belief(40), np.ones(40), anywhere())
    assert len(out.poses) == 40
    assert (out.poses[:, 0] > 40).all()

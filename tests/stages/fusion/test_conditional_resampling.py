import math
from typing import Any

import numpy as np
import pytest
from made_beliefs import along_x, even, scattered_around

from omninav.pipeline import Context
from omninav.stages.fusion.conditional_resampling import ConditionalResampling
from omninav.stages.geometry.probability.gaussians import density
from omninav.stages.values.belief import GaussianMixture, Particles


def around(x: float, number: int = 2000) -> Particles:
    return scattered_around((x, 0.0, 0.0), 0.2, number)


def at(*places: float, weights: tuple[float, ...] | None = None) -> GaussianMixture:
    return along_x(*places, sigma=0.2, weights=weights)


FOUR = Particles(along_x(0.0, 1.0, 2.0, 3.0).means, np.array([0.1, 0.2, 0.3, 0.4]))


def fuse(particles: Particles, hypothesis: GaussianMixture | None, seed: int = 1, **options: Any) -> Particles:
    ctx = Context("fusion", np.random.default_rng(seed))
    return ConditionalResampling(**options).step(ctx, particles, hypothesis).belief


def test_where_map_and_belief_agree_the_belief_becomes_their_product() -> None:
    # N(0, 0.2^2) times N(0.2, 0.2^2) is N(0.1, 0.02), worked by hand.
    out = fuse(around(0.0, 20_000), at(0.2))
    assert out.poses[:, 0].mean() == pytest.approx(0.1, abs=0.01)
    assert out.poses[:, 0].var() == pytest.approx(0.02, rel=0.1)
    assert np.allclose(out.weights, 1 / 20_000)


def test_new_hypotheses_are_drawn_by_their_weight() -> None:
    out = fuse(around(0.0, 20_000), at(9.0, 20.0, weights=(0.25, 0.75)))
    far = out.poses[:, 0] > 15.0
    assert out.weights[far].sum() == pytest.approx(0.15, abs=0.01)


def test_particles_are_kept_at_random_not_by_weight() -> None:
    # Half of the particles carry nearly all of the weight; by weight they would be nearly all that is kept.
    weights = np.where(np.arange(20_000) < 10_000, 0.999, 0.001)
    particles = Particles(np.column_stack([np.arange(20_000.0), np.zeros((20_000, 2))]), weights / weights.sum())
    out = fuse(particles, at(-900.0))
    kept = out.poses[out.poses[:, 0] > -1.0, 0]
    assert len(kept) == 16_000
    assert (kept < 10_000).mean() == pytest.approx(0.5, abs=0.02)


def test_without_anything_near_in_the_map_the_belief_stays_as_it_is() -> None:
    particles = around(0.0)
    assert fuse(particles, None) is particles
    assert fuse(particles, at()) is particles


def test_agreement_is_the_mean_density_by_the_particles_weights() -> None:
    # A quarter of the weight stands at the peak of two equal Gaussians, 0.5 (2 pi)^-1.5; the rest is far from both.
    both = along_x(0.0, 500.0, sigma=1.0, weights=(3.0, 3.0))
    particles = Particles(along_x(0.0, 90.0).means, np.array([0.25, 0.75]))
    agreement = 0.25 * 0.5 * (2 * math.pi) ** -1.5
    for above, agreed in ((agreement * 0.99, True), (agreement * 1.01, False)):
        ctx = Context("fusion", np.random.default_rng(1))
        out = ConditionalResampling(agree_above=above).step(ctx, particles, both).belief
        assert ctx.counts == ({"agreed": 1} if agreed else {"disagreed": 1})
        assert (out.poses[:, 0] == 0.0).all() == agreed


def test_the_outlier_probability_mixes_the_density_with_its_mean() -> None:
    # Half of the weight at the peak p: the mean is p / 2, and the two halves weigh 0.8 p + 0.1 p and 0.1 p.
    out = fuse(even(along_x(*[0.0] * 50, *[9.0] * 50).means), at(0.0), outlier_probability=0.2)
    assert (out.poses[:, 0] == 0.0).sum() == 90
    assert out.weights == pytest.approx(np.full(100, 0.01))


def test_what_is_kept_has_its_share_of_the_weight_and_its_own_proportions() -> None:
    out = fuse(FOUR, at(900.0), keep=0.5)
    old, new = out.poses[:, 0] < 10.0, out.poses[:, 0] > 800.0
    assert (old.sum(), new.sum()) == (2, 2)
    assert np.diff(out.poses[old, 0]) > 0.0
    before = 0.1 * (1.0 + out.poses[old, 0])
    assert out.weights[old] == pytest.approx(0.5 * before / before.sum())
    assert out.weights[new] == pytest.approx([0.25, 0.25])


def test_all_of_the_belief_can_be_kept_and_a_kept_part_without_weight_gets_none() -> None:
    same = fuse(FOUR, at(900.0), keep=1.0)
    assert same.poses.tolist() == FOUR.poses.tolist()
    assert same.weights == pytest.approx(FOUR.weights)
    anew = fuse(FOUR, at(900.0), keep=0.0)
    assert anew.poses[:, 0].min() > 800.0
    assert anew.weights == pytest.approx([0.25] * 4)
    lone = Particles(along_x(*range(100)).means, np.eye(100)[0])
    seed = next(s for s in range(9) if 0 not in np.random.default_rng(s).permutation(100)[:50])
    out = fuse(lone, at(900.0), seed=seed, keep=0.5)
    assert out.weights[out.poses[:, 0] < 200.0].tolist() == [0.0] * 50
    assert out.weights.sum() == pytest.approx(1.0)


def test_a_lone_new_particle_has_all_the_weight_that_is_not_kept() -> None:
    out = fuse(even(along_x(*range(5)).means), at(900.0))
    assert out.weights == pytest.approx([0.2] * 5)
    assert (out.poses[:, 0] > 800.0).tolist() == [False] * 4 + [True]


def test_agreement_at_the_border_itself_is_none() -> None:
    particles, hypothesis = around(0.0, 10), at(0.1)
    likely = density(particles.poses, hypothesis.means, hypothesis.covariances, hypothesis.weights)
    ctx = Context("fusion", np.random.default_rng(1))
    ConditionalResampling(agree_above=float(particles.weights @ likely)).step(ctx, particles, hypothesis)
    assert ctx.counts == {"disagreed": 1}

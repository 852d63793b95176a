"""What the fusion stages do with their own parameters: the numbers that papers give and pages rest on."""

import numpy as np
import pytest

from omninav.pipeline import Context, Tick
from omninav.stages.fusion.conditional_resampling import ConditionalResampling
from omninav.stages.fusion.covariance_intersection import CovarianceIntersection
from omninav.stages.fusion.growing_prior import MixtureInMap, ParticlesInMap
from omninav.stages.fusion.importance_resampling import ImportanceResampling, kld_number
from omninav.stages.fusion.particle_clustering import ParticleClustering
from omninav.stages.fusion.particle_prior import ParticlePrior
from omninav.stages.fusion.uniform_recovery import UniformRecovery
from omninav.stages.values.belief import GaussianMixture, Likelihood, Particles
from omninav.stages.values.maps import ReferenceGraph
from omninav.stages.values.view_mixtures import ViewMixtures


def context() -> Context:
    ctx = Context("fusion", np.random.default_rng(0))
    ctx.tick = Tick(0, 0, first_of_log=True)
    return ctx


def particles(*poses: tuple[float, float, float]) -> Particles:
    return Particles(np.array(poses, np.float64), np.full(len(poses), 1.0 / len(poses)))


@pytest.mark.parametrize(("density", "agreed"), [(1.1e-4, True), (0.9e-4, False)])
def test_map_and_belief_agree_above_a_ten_thousandth_else_four_fifths_stay(density: float, agreed: bool) -> None:
    # A Gaussian that is wide in x has the density (2 pi)^-1.5 / sigma at its middle. Porta & Kroese 2004, section 3.1.
    wide = np.diag([((2 * np.pi) ** -1.5 / density) ** 2, 1.0, 1.0])[None]
    hypothesis = GaussianMixture(np.zeros((1, 3)), wide, np.ones(1))
    ctx = context()
    out = ConditionalResampling().step(ctx, particles(*[(0.0, 0.0, 0.0)] * 10), hypothesis).belief
    assert dict(ctx.counts) == ({"agreed": 1} if agreed else {"disagreed": 1})
    assert (out.poses == 0.0).all(axis=1).sum() == (10 if agreed else 8)


def test_beliefs_are_resampled_below_half_of_their_effective_size() -> None:
    # Weights 3 : 1 of two halves: (4 / 2)^2 / (10 / 2) = 0.8 of the number;
    # 99 : 1, 0.51; 1 : 0, a half, which still is enough; a quarter of all, no more.
    for ratio, share, kept in ((3.0, 0.5, True), (99.0, 0.5, True), (np.inf, 0.5, True), (np.inf, 0.25, False)):
        values = np.where(np.arange(4096) < share * 4096, 1.0, 1.0 / ratio)
        belief = Particles(np.arange(12288.0).reshape(4096, 3), np.full(4096, 1 / 4096))
        out = ImportanceResampling(number=4096).step(context(), belief, Likelihood(values), None).belief
        assert np.array_equal(out.poses, belief.poses) == kept


def test_a_kidnapping_has_a_ten_millionth_and_its_hypotheses_a_tenth_of_5000_particles() -> None:
    believed, there = particles(*[(0.0, 0.0, 0.0)] * 5000), particles((9.0, 0.0, 0.0))
    out = ImportanceResampling().step(context(), believed, Likelihood(np.ones(5000), 1e6), there).belief
    assert (len(out.poses), out.recovery_particles) == (5000, 500)
    assert out.weights[out.poses[:, 0] == 9.0].sum() == pytest.approx(0.1 / (0.1 + 1.0), rel=1e-6)


def test_the_number_of_particles_follows_cells_of_a_quarter_of_a_metre_and_ten_degrees() -> None:
    # Fox 2001, within 0.05 with 99 %: 4 x 3 x 36 cells, one particle in the middle of each.
    poses = [
        (0.25 * x + 0.125, 0.25 * y + 0.125, np.radians(10 * h + 5))
        for x in range(4)
        for y in range(3)
        for h in range(36)
    ]
    stage = ImportanceResampling(adapt="kld", number=100_000)
    out = stage.step(context(), particles(*poses), Likelihood(np.ones(len(poses))), None).belief
    assert len(out.poses) == kld_number(432, 0.05, 0.99) > 4000
    few = stage.step(context(), particles(*poses[:2]), Likelihood(np.ones(2)), None).belief
    assert len(few.poses) == 500


def test_clusters_are_of_cells_of_half_a_metre_and_thirty_degrees() -> None:
    def number(*poses: tuple[float, float, float]) -> int:
        return len(ParticleClustering().step(context(), particles(*poses)).state)

    assert number((0.1, 0.1, 0.1), (0.9, 0.9, 0.1)) == 1  # cells that touch
    assert number((0.1, 0.1, 0.1), (1.1, 0.1, 0.1)) == 2  # a cell in between
    assert number((0.1, 0.1, np.radians(1)), (0.1, 0.1, np.radians(59))) == 1
    assert number((0.1, 0.1, np.radians(1)), (0.1, 0.1, np.radians(61))) == 2


def test_clusters_of_a_hundredth_are_kept_and_as_wide_as_a_centimetre_and_half_a_degree() -> None:
    weights = np.array([0.98, 0.0101, 0.0099])
    cloud = Particles(np.array([[0.0, 0.0, 0.0], [9.0, 0.0, 0.0], [18.0, 0.0, 0.0]]), weights)
    state = ParticleClustering().step(context(), cloud).state
    assert state.means[:, 0].tolist() == [0.0, 9.0]
    assert state.weights == pytest.approx(weights[:2] / weights[:2].sum())
    assert np.sqrt(np.diagonal(state.covariances[0])) == pytest.approx([0.01, 0.01, np.radians(0.5)])


def test_first_beliefs_have_5000_particles_or_1000_in_a_map_of_views() -> None:
    poses = np.array([[0.0, 0.0, 0.0]])
    map = ReferenceGraph(poses, np.zeros((1, 1, 1), np.float32), "histograms", np.zeros((0, 2), np.int64), "truth")
    belief = ParticlePrior().step(context(), map, None).belief
    assert belief is not None
    assert len(belief.poses) == 5000
    # Two length scales of half a metre around each reference.
    assert np.hypot(*belief.poses[:, :2].T).max() == pytest.approx(1.0, rel=0.02)
    begun = ParticlesInMap().step(context(), ViewMixtures.empty(), None).belief
    assert begun is not None
    assert len(begun.poses) == 1000
    first = MixtureInMap().step(context(), ViewMixtures.empty(), None).belief
    assert first is not None
    assert np.sqrt(np.diagonal(first.covariances[0])) == pytest.approx([0.01, 0.01, np.radians(0.5)])


def test_fifty_of_5000_particles_are_random() -> None:
    # Wolf, Burgard & Burkhardt 2005, section VI-C.
    here, there = particles((0.0, 0.0, 0.0)), particles((9.0, 0.0, 0.0))
    out = UniformRecovery().step(context(), here, Likelihood(np.ones(1)), there).belief
    assert [(out.poses[:, 0] == x).sum() for x in (0.0, 9.0)] == [4950, 50]


def test_components_correspond_up_to_95_per_cent_and_light_ones_go_below_a_hundredth_of_the_heaviest() -> None:
    def fused(apart: float, weight: float = 1.0) -> GaussianMixture:
        one, other = (
            GaussianMixture(np.array([[x, 0.0, 0.0]]), 0.5 * np.eye(3)[None], np.ones(1)) for x in (0.0, apart)
        )
        return (
            CovarianceIntersection()
            .step(context(), one, GaussianMixture(other.means, other.covariances, np.array([weight])))
            .belief
        )

    assert [len(fused(squared**0.5)) for squared in (7.8, 7.82)] == [1, 2]
    assert [len(fused(99.0, weight)) for weight in (0.0101, 0.0099)] == [2, 1]
    many = GaussianMixture(np.arange(603.0).reshape(201, 3) * 9, np.stack([np.eye(3) * 0.01] * 201), np.ones(201))
    assert len(CovarianceIntersection().step(context(), many, None).belief) == 200

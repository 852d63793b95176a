"""What the fusion stages do with their own parameters: the numbers that papers give and pages rest on."""

import numpy as np
import pytest
from made_beliefs import along_x, even
from made_references import references
from made_ticks import at_tick

from omninav.stages.fusion.conditional_resampling import ConditionalResampling
from omninav.stages.fusion.covariance_intersection import CovarianceIntersection
from omninav.stages.fusion.growing_prior import MixtureInMap, ParticlesInMap
from omninav.stages.fusion.importance_resampling import ImportanceResampling, kld_number
from omninav.stages.fusion.particle_clustering import ParticleClustering
from omninav.stages.fusion.particle_prior import ParticlePrior
from omninav.stages.values.belief import GaussianMixture, Likelihood, Particles
from omninav.stages.values.view_mixtures import ViewMixtures


@pytest.mark.parametrize(("density", "agreed"), [(1.1e-4, True), (0.9e-4, False)])
def test_map_and_belief_agree_above_a_ten_thousandth_else_four_fifths_stay(density: float, agreed: bool) -> None:
    # A Gaussian that is wide in x has the density (2 pi)^-1.5 / sigma at its middle. Porta & Kroese 2004, section 3.1.
    wide = np.diag([((2 * np.pi) ** -1.5 / density) ** 2, 1.0, 1.0])[None]
    hypothesis = GaussianMixture(np.zeros((1, 3)), wide, np.ones(1))
    ctx = at_tick(first=True)
    out = ConditionalResampling().step(ctx, even(np.zeros((10, 3))), hypothesis).belief
    assert dict(ctx.counts) == ({"agreed": 1} if agreed else {"disagreed": 1})
    assert (out.poses == 0.0).all(axis=1).sum() == (10 if agreed else 8)


def test_beliefs_are_resampled_below_half_of_their_effective_size() -> None:
    # Weights 3 : 1 of two halves: (4 / 2)^2 / (10 / 2) = 0.8 of the number;
    # 99 : 1, 0.51; 1 : 0, a half, which still is enough; a quarter of all, no more.
    for ratio, share, kept in ((3.0, 0.5, True), (99.0, 0.5, True), (np.inf, 0.5, True), (np.inf, 0.25, False)):
        values = np.where(np.arange(4096) < share * 4096, 1.0, 1.0 / ratio)
        belief = even(np.arange(12288.0).reshape(4096, 3))
        out = ImportanceResampling(number=4096).step(at_tick(first=True), belief, Likelihood(values), None).belief
        assert np.array_equal(out.poses, belief.poses) == kept


def test_a_kidnapping_has_a_ten_millionth_and_its_hypotheses_a_tenth_of_5000_particles() -> None:
    believed, there = even(np.zeros((5000, 3))), even([(9.0, 0.0, 0.0)])
    out = ImportanceResampling().step(at_tick(first=True), believed, Likelihood(np.ones(5000), 1e6), there).belief
    assert (len(out.poses), out.recovery_particles) == (5000, 500)
    assert out.weights[out.poses[:, 0] == 9.0].sum() == pytest.approx(0.1 / (0.1 + 1.0), rel=1e-6)


def test_the_number_of_particles_follows_cells_of_a_quarter_of_a_metre_and_ten_degrees() -> None:
    # Fox 2001, within 0.05 with 99 %: 4 x 3 x 36 cells, one particle in the middle of each.
    poses = (np.indices((4, 3, 36)).reshape(3, -1).T + 0.5) * (0.25, 0.25, np.radians(10))
    stage = ImportanceResampling(adapt="kld", number=100_000)
    out = stage.step(at_tick(first=True), even(poses), Likelihood(np.ones(432)), None).belief
    assert len(out.poses) == kld_number(432, 0.05, 0.99) > 4000
    few = stage.step(at_tick(first=True), even(poses[:2]), Likelihood(np.ones(2)), None).belief
    assert len(few.poses) == 500


def test_clusters_are_of_cells_of_half_a_metre_and_thirty_degrees() -> None:
    def number(*poses: tuple[float, float, float]) -> int:
        return len(ParticleClustering().step(at_tick(first=True), even(poses)).state)

    assert number((0.1, 0.1, 0.1), (0.9, 0.9, 0.1)) == 1  # cells that touch
    assert number((0.1, 0.1, 0.1), (1.1, 0.1, 0.1)) == 2  # a cell in between
    assert number((0.1, 0.1, np.radians(1)), (0.1, 0.1, np.radians(59))) == 1
    assert number((0.1, 0.1, np.radians(1)), (0.1, 0.1, np.radians(61))) == 2


def test_clusters_of_a_hundredth_are_kept_and_as_wide_as_a_centimetre_and_half_a_degree() -> None:
    weights = np.array([0.98, 0.0101, 0.0099])
    cloud = Particles(along_x(0.0, 9.0, 18.0).means, weights)
    state = ParticleClustering().step(at_tick(first=True), cloud).state
    assert state.means[:, 0].tolist() == [0.0, 9.0]
    assert state.weights == pytest.approx(weights[:2] / weights[:2].sum())
    assert np.sqrt(np.diagonal(state.covariances[0])) == pytest.approx([0.01, 0.01, np.radians(0.5)])


def test_first_beliefs_have_5000_particles_or_1000_in_a_map_of_views() -> None:
    belief = ParticlePrior().step(at_tick(first=True), references(np.zeros((1, 3))), None).belief
    assert belief is not None
    assert len(belief.poses) == 5000
    # Two length scales of half a metre around each reference.
    assert np.hypot(*belief.poses[:, :2].T).max() == pytest.approx(1.0, rel=0.02)
    begun = ParticlesInMap().step(at_tick(first=True), ViewMixtures.empty(), None).belief
    assert begun is not None
    assert len(begun.poses) == 1000
    first = MixtureInMap().step(at_tick(first=True), ViewMixtures.empty(), None).belief
    assert first is not None
    assert np.sqrt(np.diagonal(first.covariances[0])) == pytest.approx([0.01, 0.01, np.radians(0.5)])


def test_components_correspond_up_to_95_per_cent_and_light_ones_go_below_a_hundredth_of_the_heaviest() -> None:
    def number(apart: float, weight: float = 1.0) -> int:
        one, other = along_x(0.0, sigma=0.5**0.5), along_x(apart, sigma=0.5**0.5, weights=(weight,))
        return len(CovarianceIntersection().step(at_tick(first=True), one, other).belief)

    assert [number(squared**0.5) for squared in (7.8, 7.82)] == [1, 2]
    assert [number(99.0, weight) for weight in (0.0101, 0.0099)] == [2, 1]
    many = along_x(*range(0, 1809, 9))
    assert (len(many), len(CovarianceIntersection().step(at_tick(first=True), many, None).belief)) == (201, 200)

import numpy as np
import pytest
from made_beliefs import along_x, even, scattered_around

import omninav
from omninav.pipeline import Context, Tick
from omninav.stages.fusion.importance_resampling import ImportanceResampling, kld_number
from omninav.stages.fusion.uniform_recovery import UniformRecovery
from omninav.stages.values.belief import Likelihood, Particles
from omninav.stages.values.commands import Reinitialise

THERE = even(np.full((50, 3), 77.0))
"""Proposed poses, far from the belief."""


def belief(number: int = 1000, spread: float = 1.0) -> Particles:
    return scattered_around(0.0, spread, number)


def share_there(belief: Particles) -> float:
    return float(belief.weights[belief.poses[:, 0] == 77.0].sum())


def fuse(
    stage: ImportanceResampling,
    particles: Particles,
    values: np.ndarray,
    seed: int = 0,
    anywhere: float | None = None,
    proposals: Particles | None = None,
) -> Particles:
    ctx = Context("fusion", np.random.default_rng(seed))
    return stage.step(ctx, particles, Likelihood(values, anywhere), proposals).belief


def test_weights_are_multiplied_where_many_particles_still_carry_them() -> None:
    particles, values = belief(), np.linspace(1.0, 2.0, 1000)
    out = fuse(ImportanceResampling(number=1000), particles, values)
    assert np.array_equal(out.poses, particles.poses)
    assert np.allclose(out.weights, values / values.sum())


@pytest.mark.parametrize("stage", [ImportanceResampling(), UniformRecovery()])
def test_few_particles_with_weight_are_resampled_to_the_same_mean(stage: ImportanceResampling) -> None:
    # A Gaussian times a Gaussian likelihood: the posterior mean is worked by hand, (0 + 0.5 / 0.1^2) / (1 + 1 / 0.1^2).
    particles = belief(50_000)
    values = np.exp(-0.5 * ((particles.poses[:, 0] - 0.5) / 0.1) ** 2)
    out = fuse(stage, particles, values)
    assert len(out.poses) == 5000
    assert np.allclose(out.weights, 1 / 5000)
    assert out.poses[:, 0].mean() == pytest.approx(50 / 101, abs=0.01)
    assert out.poses[:, 0].std() == pytest.approx((1 / 101) ** 0.5, rel=0.1)


@pytest.mark.parametrize("values", [np.zeros(1000), np.full(1000, np.nan), np.full(1000, np.inf)])
@pytest.mark.parametrize("stage", [ImportanceResampling(number=1000), UniformRecovery(number=1000)])
def test_a_view_that_nothing_explains_changes_nothing_and_is_told_of(
    stage: ImportanceResampling, values: np.ndarray
) -> None:
    ctx, particles = Context("fusion", np.random.default_rng(0)), belief()
    out = stage.step(ctx, particles, Likelihood(values), None).belief
    assert np.allclose(np.sort(out.poses[:, 0]), np.sort(particles.poses[:, 0]))
    assert np.allclose(out.weights, particles.weights)
    assert ctx.counts["belief_without_support"] == 1


@pytest.mark.parametrize(("anywhere", "believed"), [(1.0, 1.0), (1.0, 0.01), (0.001, 1.0)])
def test_a_kidnapped_robot_is_where_the_evidence_says(anywhere: float, believed: float) -> None:
    # A tenth of the particles explain the view, so that resampling is due.
    values = np.where(np.arange(10_000) % 10 == 0, believed, 0.0)
    stage = ImportanceResampling(number=10_000, kidnapping_probability=0.01)
    out = fuse(stage, belief(10_000), values, anywhere=anywhere, proposals=THERE)
    assert out.weights.sum() == pytest.approx(1.0)
    # Bayes by hand: 0.01 x anywhere against 0.99 x the mean likelihood of the belief (a tenth of `believed`).
    expected = 0.01 * anywhere / (0.01 * anywhere + 0.99 * 0.1 * believed)
    assert share_there(out) == pytest.approx(expected, rel=1e-6)


def test_a_belief_that_explains_nothing_anywhere_gives_way_to_the_evidence() -> None:
    # All particles alike unlikely: nothing would have to be resampled, were it not for the proposals' share.
    for believed, share in ((1e-3, 0.0), (1e-9, 0.1 / 1.1), (1e-12, 100 / 101)):
        out = fuse(ImportanceResampling(), belief(5000), np.full(5000, believed), anywhere=1e-3, proposals=THERE)
        assert share_there(out) == pytest.approx(share, abs=1e-4)


@pytest.mark.parametrize(("spread", "share"), [(0.5, 1e-7), (20.0, 0.5)])
def test_half_of_a_first_belief_and_of_one_that_starts_again_anywhere_goes_to_what_the_image_suggests(
    spread: float, share: float
) -> None:
    # Bayes by hand: half of it, or the kidnapping probability, where the image is as likely there as in the belief.
    ctx, stage = Context("fusion", np.random.default_rng(0)), ImportanceResampling()
    for first, restart, expected in ((True, None, share), (False, Reinitialise(), share), (False, None, 1e-7)):
        ctx.tick = Tick(0, 0, first_of_log=first)
        out = stage.step(ctx, belief(5000, spread=spread), Likelihood(np.ones(5000), 1.0), THERE, restart).belief
        assert share_there(out) == pytest.approx(expected, rel=1e-3)
    ctx.tick, stage = Tick(0, 0, first_of_log=True), ImportanceResampling(kidnapping_probability=0.0)
    out = stage.step(ctx, belief(5000, spread=spread), Likelihood(np.ones(5000), 1.0), THERE).belief
    assert share_there(out) == 0.0


def test_who_asks_a_running_filter_to_start_again_is_heard_by_all_that_begin_a_log() -> None:
    wires = omninav.compose("omninav").settings["wires"]
    asked = {node for node, ports in wires.items() if "restart" in ports}
    assert asked >= {"prior", "fusion", "landmark_update", "monitor"}


def test_a_robot_that_stands_is_kidnapped_less_often_and_one_whose_view_breaks_off_more_often() -> None:
    ctx, stage = Context("fusion"), ImportanceResampling(kidnapping_probability=1e-3)
    shares = []
    for seen in ((1.0,), (0.1,), (0.1, 0.2), (1.0, 1e-9)):
        shares.append(share_there(stage.step(ctx, belief(5000), Likelihood(np.ones(5000), 1.0, *seen), THERE).belief))
    assert shares[0] == pytest.approx(10 * shares[1], rel=0.01)
    assert shares[2:] == pytest.approx([0.2, shares[0]], rel=0.01)


@pytest.mark.parametrize(("width", "number"), [(1.0, kld_number(4, 0.05, 0.99)), (90.0, kld_number(2, 0.05, 0.99))])
def test_cells_are_as_high_in_heading_as_asked(monkeypatch: pytest.MonkeyPatch, width: float, number: int) -> None:
    poses = np.array([[0.1, 0.1, np.radians(turn)] for turn in (1.5, 3.5, 91.5, 93.5)])
    monkeypatch.setattr("omninav.stages.fusion.importance_resampling.CELL_DEG", width)
    monkeypatch.setattr("omninav.stages.fusion.importance_resampling.MIN_PARTICLES", 1)
    stage = ImportanceResampling(number=900, adapt="kld")
    assert len(fuse(stage, even(poses), np.ones(4)).poses) == number


def with_recovery(weight: float, kidnapping_probability: float, novelty: float = 1.0) -> Particles:
    """Eight particles at 0 and two recovery particles at 5 of this weight, after an image that all explain alike and
    that proposes 9; of the ten that follow two are recovery particles."""
    weights = np.array([(1.0 - weight) / 8] * 8 + [weight / 2] * 2)
    stage = ImportanceResampling(number=10, recovery_share=0.2, kidnapping_probability=kidnapping_probability)
    believed = Particles(along_x(*[0.0] * 8, 5.0, 5.0).means, weights, 2)
    likelihood = Likelihood(np.ones(10), 1.0, novelty)
    return stage.step(Context("fusion"), believed, likelihood, even([(9.0, 0.0, 0.0)] * 2)).belief


def test_of_a_mixture_the_uniform_part_has_the_weight_of_a_kidnapping() -> None:
    # p = 0.4 and an image of half novelty: 0.2 of the weight is uniform, 0.8 of it the belief's.
    out = with_recovery(0.1, 0.4, novelty=0.5)
    assert out.recovery_particles == 2
    assert out.weights.sum() == pytest.approx(1.0)
    assert out.poses[:8, 0].tolist() == [0.0] * 8
    assert len(set(out.weights[:8])) == 1
    # Drawn by fit, 1, 1 and twice the novelty of 0.5: in all 3, so that each of two drawn counts 1.5 w / fit.
    recovery = {5.0: 0.8 * 0.05 / 1.0 * 1.5, 9.0: 0.2 * 0.5 / 0.5 * 1.5}
    expected = np.array([recovery[x] for x in out.poses[8:, 0]])
    assert out.weights[8:] / out.weights[0] == pytest.approx(expected / (0.8 * 0.9 / 8))


@pytest.mark.parametrize(("weight", "joined"), [(0.42, True), (0.38, False)])
def test_recovery_particles_that_outweigh_their_share_are_resampled_with_the_others(
    weight: float, joined: bool
) -> None:
    # Half of the weight goes to the uniform part: 10 x 0.5 x 0.42 is more than two particles, 10 x 0.5 x 0.38 is not.
    out = with_recovery(weight, 0.5)
    assert out.recovery_particles == 2
    assert out.poses[8:, 0].tolist() == ([9.0, 9.0] if joined else [5.0, 9.0])
    assert (5.0 in out.poses[:8, 0]) == joined


def test_recovery_particles_that_weigh_just_their_share_stay_apart() -> None:
    # A quarter of eight particles is two, and half of a half of the weight is two of eight, in exact numbers.
    stage = ImportanceResampling(number=8, recovery_share=0.25, kidnapping_probability=0.5)
    believed = Particles(along_x(*[0.0] * 4, *[5.0] * 4).means, np.full(8, 0.125), 4)
    out = stage.step(Context("fusion"), believed, Likelihood(np.ones(8), 1.0), even([(9.0, 0.0, 0.0)])).belief
    assert out.poses[:6, 0].tolist() == [0.0] * 6
    assert 5.0 in out.poses[6:, 0]


def test_particles_are_resampled_where_their_effective_size_is_below_its_share() -> None:
    # Weights 0.4, 0.4, 0.1, 0.1: 1 / 0.34 = 2.94 of 4.
    poses, weights = np.arange(12.0).reshape(4, 3), np.array([0.4, 0.4, 0.1, 0.1])
    for below, kept in ((0.73, True), (0.74, False)):
        out = fuse(ImportanceResampling(number=4, resample_below=below), even(poses), weights)
        assert (out.weights == pytest.approx(weights)) == kept
        assert (out.weights == pytest.approx(np.full(4, 0.25))) != kept


@pytest.mark.parametrize(("share", "anywhere", "proposals"), [(0.1, None, THERE), (0.1, 1.0, None), (0.0, 1.0, THERE)])
def test_without_what_is_likely_anywhere_proposals_or_recovery_particles_there_is_no_recovery(
    share: float, anywhere: float | None, proposals: Particles | None
) -> None:
    stage = ImportanceResampling(number=20, recovery_share=share, kidnapping_probability=0.5)
    out = fuse(stage, belief(20), np.ones(20), anywhere=anywhere, proposals=proposals)
    assert (len(out.poses), out.recovery_particles) == (20, 0)
    assert out.weights == pytest.approx(np.full(20, 0.05))


def test_the_kld_bound_is_fox_s() -> None:
    # Chi-square quantile by scipy, not the Wilson-Hilferty approximation: n = chi2_{k-1, 0.99} / (2 e).
    from scipy.stats import chi2

    for cells in (2, 5, 50, 500):
        assert kld_number(cells, 0.05, 0.99) == pytest.approx(chi2.ppf(0.99, cells - 1) / 0.1, rel=0.01)
    assert kld_number(1, 0.05, 0.99) == 1

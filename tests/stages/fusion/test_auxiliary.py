import numpy as np
import pytest
from made_beliefs import along_x, even

from omninav.pipeline import Context
from omninav.stages.fusion.conditional_resampling import ConditionalResampling, auxiliary_filter
from omninav.stages.values.belief import GaussianMixture, Particles
from omninav.stages.values.pose import UncertainMotion

AHEAD = UncertainMotion((0.0, 1.0, 0.0), (0.0, 0.3, 0.0))
STILL = UncertainMotion((0.0, 0.0, 0.0), (0.0, 0.0, 0.0))


def at(x: float, sigma: float) -> GaussianMixture:
    return GaussianMixture(np.array([[x, 0.0, 0.0]]), np.diag([sigma**2, 1.0, 1.0])[None], np.ones(1))


def known(number: int) -> Particles:
    return even(np.random.default_rng(0).normal(0.0, (0.2, 0.0, 0.0), (number, 3)))


def few(*places: float) -> Particles:
    return even(along_x(*places).means)


def found(
    particles: Particles, view: GaussianMixture, motion: UncertainMotion = AHEAD, floor: float = 0.0
) -> Particles:
    out = auxiliary_filter(particles, motion, view, floor, np.random.default_rng(1))
    assert out is not None
    return out


def test_its_mean_and_variance_are_those_of_the_exact_filter() -> None:
    # N(0, 0.2^2) moved by N(1, 0.3^2) is N(1, 0.13); times N(1.4, 0.3^2): mean (1/.13 + 1.4/.09) / (1/.13 + 1/.09).
    # A view that counts twice would leave a variance of 1 / (1/.13 + 2/.09).
    out = found(known(100_000), at(1.4, 0.3))
    precision = 1 / 0.13 + 1 / 0.09
    mean = float(out.weights @ out.poses[:, 0])
    assert mean == pytest.approx((1 / 0.13 + 1.4 / 0.09) / precision, abs=0.005)
    assert float(out.weights @ (out.poses[:, 0] - mean) ** 2) == pytest.approx(1 / precision, rel=0.03)


def test_particles_are_selected_by_their_predicted_poses() -> None:
    # After a metre ahead two of four stand at 1 and 5 m; the view is at 5 m, so that those at 4 m go on.
    out = found(few(0.0, 0.0, 4.0, 4.0), at(5.0, 0.1), UncertainMotion((0.0, 1.0, 0.0), (0.0, 0.0, 0.0)))
    assert out.poses[:, 0].tolist() == [5.0] * 4
    assert out.weights == pytest.approx([0.25] * 4)


@pytest.mark.parametrize("sigma", [0.0, 0.3])
def test_weights_are_the_view_at_the_pose_over_the_view_at_the_prediction(sigma: float) -> None:
    # Densities of one Gaussian of 0.3 m in x: their ratio needs no normalisation.
    out = found(few(0.0, 0.0), at(1.2, 0.3), UncertainMotion((0.0, 1.0, 0.0), (0.0, sigma, 0.0)))
    likely = np.exp(-0.5 * ((out.poses[:, 0] - 1.2) / 0.3) ** 2)
    assert out.weights == pytest.approx(likely / likely.sum())
    assert len(set(out.poses[:, 0])) == (2 if sigma else 1)


def test_the_scale_of_the_hypothesis_does_not_matter_beside_the_floor() -> None:
    # A hypothesis's weights need not sum to 1, p(y|x) is that of their shares: of two components half of their density,
    # beside which a floor as high as that counts 1.
    half = (2 * np.pi) ** -1.5 / 0.3 / 2
    wide = UncertainMotion((0.0, 1.0, 0.0), (0.0, 0.5, 0.0))
    for weight in (0.5, 1.0, 0.2):
        means = np.array([[1.0, 0.0, 0.0], [99.0, 0.0, 0.0]])
        view = GaussianMixture(means, np.stack([np.diag([0.09, 1.0, 1.0])] * 2), np.full(2, weight))
        belief = found(few(0.0, 0.5), view, wide, half)
        likely = 1.0 + np.exp(-0.5 * ((belief.poses[:, 0] - 1.0) / 0.3) ** 2)
        first = 1.0 + np.exp(-0.5 * ((np.array([1.0, 1.5]) - 1.0) / 0.3) ** 2)
        assert belief.weights == pytest.approx(likely / first / (likely / first).sum())


def test_the_selected_particles_move_with_noise_in_all_three_steps() -> None:
    turning = UncertainMotion((0.5, 1.0, -0.5), (0.1, 0.2, 0.3))
    anywhere = GaussianMixture(np.zeros((1, 3)), np.diag([1e6, 1e6, 1e6])[None], np.ones(1))
    out = found(even(np.zeros((20_000, 3))), anywhere, turning)
    along = np.hypot(out.poses[:, 0], out.poses[:, 1])
    assert along.std() == pytest.approx(0.2, rel=0.03)
    assert np.arctan2(out.poses[:, 1], out.poses[:, 0]).std() == pytest.approx(0.1, rel=0.03)
    assert out.poses[:, 2].std() == pytest.approx(0.1 * 10**0.5, rel=0.03)


def test_a_particle_by_itself_keeps_all_the_weight_however_badly_it_fits() -> None:
    out = found(few(0.0), at(1.0, 0.03))
    assert out.poses[0, 0] != 1.0
    assert out.weights.tolist() == [1.0]


def test_a_view_that_fits_no_prediction_gives_no_belief_unless_there_is_a_floor() -> None:
    far = at(99.0, 0.3)
    with np.errstate(all="raise"):
        assert auxiliary_filter(few(0.0, 4.0), AHEAD, far, 0.0, np.random.default_rng(1)) is None
    uneven = Particles(few(0.0, 4.0).poses, np.array([0.75, 0.25]))
    assert found(uneven, far, floor=1e-3).weights == pytest.approx([0.5, 0.5])


def test_a_view_that_fits_the_predictions_but_no_pose_gives_no_belief() -> None:
    wide = UncertainMotion((0.0, 1.0, 0.0), (0.0, 1000.0, 0.0))
    assert auxiliary_filter(few(0.0, 0.0), wide, at(1.0, 0.01), 0.0, np.random.default_rng(1)) is None


def test_where_the_filter_finds_nothing_the_belief_is_that_of_importance_sampling() -> None:
    # Before the motion nothing would have led there; the particles, as they moved, agree with the view.
    there, elsewhere = few(5.0, 5.0), few(-50.0, -50.0)
    stage = ConditionalResampling(sampling="auxiliary")
    out = stage.step(Context("fusion"), there, at(5.0, 0.3), elsewhere, AHEAD).belief
    assert out.poses[:, 0].tolist() == [5.0, 5.0]


def test_the_outlier_probability_is_the_floor_of_the_auxiliary_filter() -> None:
    # Half of the particles are at the peak p: the agreement is p / 2, the floor of q = 0.2 p / 10, at the peak 1.1 p.
    half = few(*[0.0] * 60, *[9.0] * 60)
    stage = ConditionalResampling(sampling="auxiliary", outlier_probability=0.2)
    out = stage.step(Context("fusion"), half, at(0.0, 0.3), half, STILL).belief
    assert (out.poses[:, 0] == 0.0).sum() == pytest.approx(120 * 1.1 / 1.2, abs=1)

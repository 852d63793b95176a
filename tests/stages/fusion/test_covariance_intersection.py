"""Fusion of mixtures: equations 2 to 8 of Gross, Koenig & Mueller 2005 against plain loops.

Errata are numbered as in docs/papers.md.
"""

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from made_beliefs import along_x
from made_mixtures import Mixture, covariances, drawn_mixture, gap, mixtures
from scipy.optimize import minimize_scalar

from omninav.pipeline import Context
from omninav.stages.fusion.covariance_intersection import (
    CovarianceIntersection,
    alpha_by_ratio,
    alpha_of_min_determinant,
    fuse,
)
from omninav.stages.geometry.probability.gaussians import intersected, squared_distances
from omninav.stages.motion.gaussian import GaussianMotion
from omninav.stages.values.belief import GaussianMixture
from omninav.stages.values.pose import Motion

MODULE = "omninav.stages.fusion.covariance_intersection"
UNIT = np.eye(3)
CTX = Context("fusion")


def mixture(*components: tuple[float, float]) -> GaussianMixture:
    """Components (x, weight) on the x axis."""
    return along_x(*(x for x, _ in components), weights=tuple(weight for _, weight in components))


def fused(*sources: GaussianMixture | None, **options: Any) -> GaussianMixture:
    return CovarianceIntersection(**options).step(CTX, *sources).belief


def parts(mixture: GaussianMixture) -> Mixture:
    return mixture.means, mixture.covariances, mixture.weights


def fused_plainly(a: Mixture, b: Mixture, gamma: float, weighted: bool) -> list[tuple[np.ndarray, np.ndarray, float]]:
    """Equations 2 to 8 word by word, with numpy's inverses; each pair has an alpha of its own."""
    match = squared_distances(a[0], a[1], b[0], b[1]) < gamma
    out = []
    for i, (mean_a, cov_a, w_a) in enumerate(zip(*a, strict=True)):
        if not match[i].any():
            out.append((mean_a, cov_a, w_a))
        for j, (mean_b, cov_b, w_b) in enumerate(zip(*b, strict=True)):
            if match[i, j]:
                s_a, s_b = (w_a, w_b) if weighted else (1.0, 1.0)
                det_a, det_b = np.linalg.det(cov_a), np.linalg.det(cov_b)
                alpha = s_b * det_a / (s_b * det_a + s_a * det_b)
                first, second = (1 - alpha) * np.linalg.inv(cov_a), alpha * np.linalg.inv(cov_b)
                covariance = np.linalg.inv(first + second)
                mean = covariance @ (first @ mean_a + second @ (mean_a + gap(mean_a, mean_b)))
                weight = w_a * w_b / b[2][match[i]].sum() + w_b * w_a / a[2][match[:, j]].sum()
                out.append((mean, covariance, weight))
    alone = np.flatnonzero(~match.any(axis=0))
    return out + [(b[0][j], b[1][j], b[2][j]) for j in alone]


@pytest.mark.parametrize("weighted", [True, False])
def test_fusion_is_the_papers_equations_written_as_loops(weighted: bool) -> None:
    rng = np.random.default_rng(0)
    for sizes in ((1, 1), (3, 5), (12, 7), (20, 20)):
        a, b = (drawn_mixture(rng, size, extent=0.8) for size in sizes)
        found = list(zip(*fuse(a, b, 7.81, weighted), strict=True))
        wanted = fused_plainly(a, b, 7.81, weighted)
        assert len(found) == len(wanted)
        for (mean, covariance, weight), (mean_w, covariance_w, weight_w) in zip(found, wanted, strict=True):
            assert np.abs(gap(mean, mean_w)).max() < 1e-8
            assert covariance == pytest.approx(covariance_w, rel=1e-6, abs=1e-10)
            assert weight == pytest.approx(weight_w, rel=1e-12)


@given(mixtures(), mixtures(), st.booleans(), st.floats(0.05, 20.0))
def test_fusion_conserves_the_sum_of_all_weights(a: Mixture, b: Mixture, weighted: bool, mass: float) -> None:
    # Erratum 5: matched pairs and unmatched copies together weigh what both mixtures weigh.
    means, covariance, weights = fuse(a, (b[0], b[1], mass * b[2]), 7.81, weighted)
    assert weights.sum() == pytest.approx(1.0 + mass, rel=1e-12)
    assert weights.min() > 0.0
    assert np.linalg.eigvalsh(covariance).min() > 0.0
    assert np.abs(means[:, 2]).max() <= math.pi


def test_weights_of_a_pair_and_of_two_on_one_worked_by_hand() -> None:
    # a = 0.6 at 0 and 0.4 at 9; b = 0.5 at 0, 0.3 at 0.01, 0.2 at 20. Of a at 0 the sum of matches is 0.8:
    # 0.6 0.5/0.8 + 0.5 0.6/0.6 = 0.875, 0.6 0.3/0.8 + 0.3 = 0.525; the rest are copies: in all 2.
    a, b = mixture((0.0, 0.6), (9.0, 0.4)), mixture((0.0, 0.5), (0.01, 0.3), (20.0, 0.2))
    weights = fuse(parts(a), parts(b), 7.81)[2]
    assert weights == pytest.approx([0.875, 0.525, 0.4, 0.2])


def test_what_no_source_supports_is_halved_by_one_normalisation() -> None:
    # Erratum 5, and figure 2: prediction and hypothesis weigh 1 each.
    out = fused(mixture((0.0, 0.5), (9.0, 0.5)), along_x(0.0))
    assert sorted(out.weights) == pytest.approx([0.25, 0.75])


def test_normalisation_waits_for_the_last_source() -> None:
    # Three sources of weight 1 that do not correspond end with a third each; normalised in between, the last had half.
    assert fused(along_x(0.0), along_x(5.0), along_x(9.0)).weights == pytest.approx([1 / 3] * 3)
    four = fused(along_x(0.0), along_x(5.0), along_x(9.0), along_x(9.0))
    assert sorted(four.weights) == pytest.approx([0.25, 0.25, 0.5])


def test_a_source_counts_by_what_its_weights_sum_to() -> None:
    # Erratum 13: hypotheses are not normalised.
    out = fused(along_x(0.0), mixture((5.0, 2.0), (9.0, 1.0)))
    assert sorted(out.weights) == pytest.approx([0.25, 0.25, 0.5])


def test_components_across_the_seam_correspond() -> None:
    # Errata 1 and 2: 0.1 rad apart over pi; equal covariances and weights meet in the middle. Erratum 4: agreement does
    # not make it more certain, as a Kalman filter's would.
    covariance = 0.01 * UNIT[None]
    a = GaussianMixture(np.array([[0, 0, math.pi - 0.05]]), covariance, np.ones(1))
    b = GaussianMixture(np.array([[0, 0, -math.pi + 0.05]]), covariance, np.ones(1))
    out = fused(a, b)
    assert len(out) == 1
    assert abs(out.means[0, 2]) == pytest.approx(math.pi)
    assert out.covariances[0] == pytest.approx(covariance[0])


# alpha


def test_the_ratio_saturates() -> None:
    # Erratum 3: C_b = 4 C_a in three dimensions has 64 times the determinant: alpha = 1 / 65.
    larger = float(np.linalg.slogdet(4 * UNIT).logabsdet)
    assert alpha_by_ratio(0.0, larger, 1.0, 1.0) == pytest.approx(1 / 65)
    assert alpha_by_ratio(larger, 0.0, 1.0, 1.0) == pytest.approx(64 / 65)
    assert alpha_by_ratio(0.0, 0.0, 0.2, 0.6) == pytest.approx(0.75)


@given(covariances(), covariances())
@settings(max_examples=50)
def test_the_least_determinant_is_found(cov_a: np.ndarray, cov_b: np.ndarray) -> None:
    first, second = np.linalg.inv(cov_a), np.linalg.inv(cov_b)

    def size(alpha: float) -> float:
        return -float(np.linalg.slogdet((1 - alpha) * first + alpha * second)[1])

    found = size(alpha_of_min_determinant(cov_a, cov_b))
    best = minimize_scalar(size, bounds=(0, 1), method="bounded", options={"xatol": 1e-10}).fun
    assert found <= min(best, size(0.0), size(1.0)) + 1e-7


def test_complementary_doubts_are_both_reduced_by_the_least_determinant() -> None:
    # One knows x well, the other y: by symmetry alpha is a half, and each of x, y gets twice the smaller variance / ~1.
    a, b = np.diag([0.01, 1.0, 0.1]), np.diag([1.0, 0.01, 0.1])
    assert alpha_of_min_determinant(a, b) == pytest.approx(0.5)
    assert alpha_of_min_determinant(UNIT, UNIT) == 0.5
    assert np.diag(intersected(np.zeros(3), a, np.zeros(3), b, 0.5)[1]) == pytest.approx([2 / 101, 2 / 101, 0.1])


@pytest.mark.parametrize(("variances", "alpha"), [((1.0, 4.0), 0.0), ((4.0, 1.0), 1.0)])
def test_where_one_is_more_certain_in_every_direction_it_has_all_the_weight(
    variances: tuple[float, float], alpha: float
) -> None:
    assert alpha_of_min_determinant(variances[0] * UNIT, variances[1] * UNIT) == pytest.approx(alpha, abs=1e-12)


def test_the_least_determinant_where_covariances_differ_in_one_direction_only() -> None:
    # det of the inverse: (1 - a / 2) along x where C_b has twice the variance, (1 + a) along y where it has half of it:
    # (1 - a / 2)(1 + a) is largest at a = 1 / 2.
    assert alpha_of_min_determinant(UNIT, np.diag([2.0, 0.5, 1.0])) == pytest.approx(0.5)
    # (1 - a / 2)(1 + 3 a): slope 2.5 - 3 a is 0 at 5 / 6.
    assert alpha_of_min_determinant(UNIT, np.diag([2.0, 0.25, 1.0])) == pytest.approx(5 / 6)
    # The same pair in other units and turned in the plane: alpha is that of the pair, not of the axes.
    turn = np.array([[0.6, -0.8, 0.3], [0.8, 0.6, -0.2], [0.1, 0.5, 1.0]])
    assert alpha_of_min_determinant(turn @ turn.T, turn @ np.diag([2.0, 0.25, 1.0]) @ turn.T) == pytest.approx(5 / 6)


def test_components_at_the_limit_do_not_correspond() -> None:
    # 1 m apart along x and along y with a summed variance of 1: a squared distance of 2, in exact numbers.
    a = np.zeros((1, 3)), 0.5 * UNIT[None], np.ones(1)
    b = np.array([[1.0, 1.0, 0.0]]), 0.5 * UNIT[None], np.ones(1)
    assert len(fuse(a, b, 2.0)[2]) == 2
    assert len(fuse(a, b, 2.0 + 1e-9)[2]) == 1


def test_the_paper_weighs_by_weight_and_porta_and_kroese_do_not() -> None:
    a, b = mixture((0.0, 0.9)), mixture((0.1, 0.1))
    assert fused(a, b).means[0, 0] == pytest.approx(0.01)
    assert fused(a, b, weighted=False).means[0, 0] == pytest.approx(0.05)
    wide = along_x(0.1, sigma=0.2, weights=(0.1,))
    assert fused(a, wide).means[0, 0] < 0.1 * 0.1 / (0.1 + 0.9 * 64)


# the stage


def test_near_components_become_one_and_light_ones_go(monkeypatch: pytest.MonkeyPatch) -> None:
    three = mixture((0.0, 0.5), (0.12, 0.48), (5.0, 0.02))
    monkeypatch.setattr(f"{MODULE}.DROP_BELOW", 0.05)
    out = fused(three, None)
    assert len(out) == 1
    assert out.weights.tolist() == [1.0]
    assert out.means[0, 0] == pytest.approx(0.12 * 0.48 / 0.98)
    monkeypatch.setattr(f"{MODULE}.DROP_BELOW", 0.0)
    monkeypatch.setattr(f"{MODULE}.MERGE_BELOW", 0.0)
    assert len(fused(three, None)) == 3


@pytest.mark.parametrize(("share", "weights"), [(0.25, [0.8, 0.2]), (0.26, [1.0])])
def test_a_component_at_the_share_below_which_they_are_dropped_stays(
    monkeypatch: pytest.MonkeyPatch, share: float, weights: list[float]
) -> None:
    monkeypatch.setattr(f"{MODULE}.DROP_BELOW", share)
    assert fused(mixture((0.0, 1.0), (9.0, 0.25)), None).weights == pytest.approx(weights)


@pytest.mark.parametrize(
    ("most", "places"), [(1, [9.0]), (2, [0.0, 9.0]), (3, [0.0, 9.0, 20.0]), (4, [0.0, 9.0, 20.0])]
)
def test_the_heaviest_components_stay_as_many_as_may(
    monkeypatch: pytest.MonkeyPatch, most: int, places: list[float]
) -> None:
    monkeypatch.setattr(f"{MODULE}.MAX_COMPONENTS", most)
    out = fused(mixture((0.0, 0.3), (9.0, 0.4), (20.0, 0.3)), None)
    assert sorted(out.means[:, 0].tolist()) == places
    assert out.weights.sum() == pytest.approx(1.0)


def test_two_equal_gaussians_merge_where_they_have_one_peak() -> None:
    # Two normal densities of one sigma have one peak up to two sigma apart: a squared distance of 2 with C_a + C_b.
    x = np.linspace(-0.2, 0.5, 7001)
    for apart, peaks in ((0.195, 1), (0.205, 2)):
        curve = np.exp(-(x**2) / 0.02) + np.exp(-((x - apart) ** 2) / 0.02)
        assert ((curve[1:-1] > curve[:-2]) & (curve[1:-1] >= curve[2:])).sum() == peaks
        assert len(fused(along_x(0.0, apart), None)) == peaks


def test_a_prediction_of_nothing_takes_the_hypothesis_and_no_weight_changes_nothing() -> None:
    nothing = along_x()
    out = fused(nothing, mixture((1.0, 0.3)))
    assert (out.means[0, 0], out.weights[0]) == (1.0, 1.0)
    assert fused(nothing, None) is nothing
    assert fused(along_x(1.0), mixture((5.0, 0.0))).means[:, 0].tolist() == [1.0]


def test_what_is_no_covariance_is_refused() -> None:
    flat = GaussianMixture(np.zeros((1, 3)), np.diag([1.0, -1.0, 1.0])[None], np.ones(1))
    with pytest.raises(ValueError, match="not positive definite"):
        fused(along_x(0.0), flat)


def test_over_hundreds_of_random_updates_covariances_stay_positive_definite_and_weights_in_0_to_1() -> None:
    rng, motion = np.random.default_rng(5), GaussianMotion()
    belief = GaussianMixture(np.zeros((1, 3)), np.diag([0.01, 0.01, 0.001])[None], np.ones(1))
    most = 0
    for turn in range(500):
        x, y, angle = rng.normal(0, [0.2, 0.02, 0.2]).tolist()
        predicted = motion.step(CTX, belief, Motion(x, y, angle)).belief
        hypothesis = GaussianMixture(*drawn_mixture(rng, int(rng.integers(1, 5)))) if turn % 3 else None
        belief = fused(predicted, hypothesis)
        np.linalg.cholesky(belief.covariances)
        assert belief.weights.min() > 0.0
        assert belief.weights.max() <= 1.0
        assert abs(belief.weights.sum() - 1.0) < 1e-12
        most = max(most, len(belief))
    assert np.array_equal(belief.covariances, np.swapaxes(belief.covariances, 1, 2))
    assert 1 < most <= 200

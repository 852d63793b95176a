"""Augmented MCL: random particles where the likelihood has fallen, against table 8.3 worked by hand."""

import numpy as np
import pytest

from omninav.pipeline import Context, Tick
from omninav.stages.fusion.augmented_recovery import (
    AugmentedRecovery,
    AugmentedRecoveryState,
    probability_explained,
)
from omninav.stages.values.belief import Likelihood, Particles

NUMBER = 1000
HERE = Particles(np.zeros((NUMBER, 3)), np.full(NUMBER, 1 / NUMBER))
THERE = Particles(np.full((50, 3), 9.0), np.full(50, 0.02))


def likelihood(value: float, mean: float | None = 0.1, novelty: float = 1.0) -> Likelihood:
    return Likelihood(np.full(NUMBER, value**novelty), mean, novelty)


def injected(images: list[Likelihood], proposals: Particles | None = THERE) -> list[int]:
    stage, state, found = AugmentedRecovery(number=NUMBER), AugmentedRecoveryState(), []
    for image in images:
        out = stage.step(Context("fusion", np.random.default_rng(0)), HERE, image, proposals, state).belief
        assert len(out.poses) == NUMBER
        assert out.weights.sum() == pytest.approx(1.0)
        found.append(int((out.poses[:, 0] > 1).sum()))
    return found


def test_a_fall_of_the_likelihood_injects_the_share_of_table_8_3():
    # p = 0.9 / (0.9 + 0.1) = 0.9 twenty times, then 0.1 / (0.1 + 0.1) = 0.5: w_slow = 0.9 - 0.4 / 21, w_fast = 0.86.
    share = 1 - 0.86 / (0.9 - 0.4 / 21)
    assert injected([likelihood(0.9)] * 20 + [likelihood(0.1)]) == [0] * 20 + [int(NUMBER * share)]


def test_the_first_images_count_alike_so_that_a_start_anywhere_does_not_stay_the_usual_case():
    lost = [likelihood(0.9)] * 30 + [likelihood(0.01)] * 5
    assert injected([likelihood(0.01), *lost])[-1] > 0.8 * injected([likelihood(0.9), *lost])[-1]


def test_a_belief_that_explains_images_as_ever_or_better_injects_nothing():
    assert injected([likelihood(0.1), likelihood(0.1), likelihood(0.9), likelihood(0.9)]) == [0, 0, 0, 0]


def test_a_lost_robot_injects_more_with_each_image():
    found = injected([likelihood(0.9)] * 30 + [likelihood(0.01)] * 8)
    assert found[:30] == [0] * 30
    assert all(np.diff(found[30:]) > 0)
    assert found[-1] > NUMBER / 3


def test_an_image_of_a_standing_robot_is_judged_as_if_it_were_new():
    assert probability_explained(HERE, likelihood(0.9, novelty=0.1)) == pytest.approx(0.9)


def test_without_proposals_or_a_mean_over_the_map_nothing_is_injected():
    assert injected([likelihood(0.9)] * 20 + [likelihood(0.01)], None) == [0] * 21
    assert injected([likelihood(0.9, None)] * 20 + [likelihood(0.01, None)]) == [0] * 21


def test_how_well_a_belief_explains_an_image_is_the_mean_over_its_weights_against_that_of_the_map():
    # 0.75 0.4 + 0.25 0.2 = 0.35, against 0.35 of the map.
    two = Particles(np.zeros((2, 3)), np.array([0.75, 0.25]))
    assert probability_explained(two, Likelihood(np.array([0.4, 0.2]), 0.35)) == pytest.approx(0.5)


@pytest.mark.parametrize(
    ("values", "mean"), [([0.4, 0.2], None), ([], 0.1), ([0.0, 0.0], 0.0), ([np.inf, 1.0], 0.1), ([0.4, 0.2], np.inf)]
)
def test_an_image_that_says_nothing_of_belief_and_map_speaks_for_the_belief(values: list[float], mean: float | None):
    some = Particles(np.zeros((len(values), 3)), np.full(len(values), 1.0 / max(len(values), 1)))
    assert probability_explained(some, Likelihood(np.array(values), mean)) == 1.0


def test_an_image_without_any_new_evidence_tells_nothing_extreme():
    # The root is limited to the thousandth: 1 ** 1000 against 1.
    assert probability_explained(HERE, Likelihood(np.ones(NUMBER), 1.0, 0.0)) == pytest.approx(0.5)


def test_a_belief_that_never_explained_an_image_injects_nothing():
    assert injected([Likelihood(np.zeros(NUMBER), 0.1)] * 3) == [0, 0, 0]


def test_averages_are_plain_means_over_the_first_images_of_each_log(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr("omninav.stages.fusion.augmented_recovery.FAST", 0.4)
    stage, state = AugmentedRecovery(number=NUMBER), AugmentedRecoveryState()
    ctx, averages = Context("fusion", np.random.default_rng(0)), []
    for number, value in enumerate((0.9, 0.1, 0.3, 0.1)):
        ctx.tick = Tick(number, number, first_of_log=number == 3)
        stage.step(ctx, HERE, likelihood(value, 0.1), THERE, state)
        averages.append((state.slow, state.fast))
    # Explained: 0.9, 0.5, 0.75, and 0.5 where a second log begins: both are means of 1 and 2; of 3 the slow one only.
    expected = [(0.9, 0.9), (0.7, 0.7), (2.15 / 3, 0.7 + 0.4 * 0.05), (0.5, 0.5)]
    assert averages == [pytest.approx(each) for each in expected]

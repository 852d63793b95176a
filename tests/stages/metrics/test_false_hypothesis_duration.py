import numpy as np
import pytest
from measured_drives import AT_ORIGIN, figures, made_drive, on_x

from omninav.stages.metrics.false_hypothesis_duration import FalseHypothesisDuration
from omninav.stages.values.belief import GaussianMixture

POINTS = "omninav.stages.metrics.false_hypothesis_duration.POINTS"


def belief(*places: tuple[float, float, float]) -> GaussianMixture:
    """Components at x, y, with their weights."""
    means = np.array([[x, y, 0.0] for x, y, _ in places])
    return GaussianMixture(means, np.tile(np.eye(3), (len(places), 1, 1)), np.array([w for _, _, w in places]))


def followed(drive, beliefs, wrong):
    return figures(FalseHypothesisDuration(), drive, beliefs, wrong)["wrong_hypotheses"]


@pytest.mark.parametrize(
    ("weights", "updates", "kept", "curve"),
    [
        pytest.param([0.5, 0.2, 0.05, 0.0, 0.0], 3.0, 0, [0.5, 0.2, 0.05, 0.0], id="until there is nothing"),
        pytest.param([0.5, 0.5, 0.5], 3.0, 1, [0.5, 0.5, 0.5], id="to the end of the drive, which is none of its own"),
        pytest.param([0.5, 0.0, 0.3], 1.0, 0, [0.5, 0.0, 0.0, 0.0], id="what comes there later is another"),
    ],
)
def test_a_wrong_hypothesis_lives_until_the_belief_has_nothing_there(
    weights: list[float], updates: float, kept: int, curve: list[float], monkeypatch: pytest.MonkeyPatch
):
    # A metre a frame along x; in frame 1 a wrong hypothesis 8 m beside, which then has these weights.
    frames = len(weights) + 1
    drive = made_drive(on_x(range(frames)), motion=[None, *[(1.0, 0.0, 0.0)] * (frames - 1)])
    there = [[(n, 8.0, weight)] if weight else [] for n, weight in enumerate([0.0, *weights])]
    beliefs = [belief((n, 0.0, 1.0), *each) for n, each in enumerate(there)]
    monkeypatch.setattr(POINTS, 4)
    assert followed(drive, beliefs, [None, belief((1.0, 8.0, 1.0)), *[None] * (frames - 2)]) == {
        "number": 1, "updates": updates, "kept": kept, "weight": pytest.approx(curve)
    }  # fmt: skip


def test_without_wrong_hypotheses_there_is_nothing_to_measure():
    drive = made_drive([AT_ORIGIN])
    assert figures(FalseHypothesisDuration(), drive, [belief((0.0, 0.0, 1.0))], [None]) is None


def test_hypotheses_are_followed_along_odometry_each_from_its_own_frame_and_figures_are_means(
    monkeypatch: pytest.MonkeyPatch,
):
    # The robot turns left by a right angle, then drives a metre; what was ahead of the first is followed in its frame.
    drive = made_drive([AT_ORIGIN] * 4, motion=[None, (0.0, 0.0, np.pi / 2), (2.0, 0.0, 0.0), (2.0, 0.0, 0.0)])
    one, other = belief((5.0, 0.0, 0.3), (50.0, 0.0, 0.9)), belief((-5.0, 0.0, 1.0))
    beliefs = [
        belief((5.0, 1.5, 0.25), (5.0, -1.5, 0.5), (5.0, 1.6, 9.0)),
        belief((5.0, 0.0, 0.5), (-5.0, 0.0, 0.25)),
        belief((5.0, 2.0, 0.25), (-3.0, 0.0, 0.5)),
        belief((5.0, 4.0, 0.125), (5.0, -4.0, 1.0)),
    ]
    monkeypatch.setattr(POINTS, 5)
    assert followed(drive, beliefs, [one, other, None, None]) == {
        "number": 2,
        "updates": 3.0,  # four to the end, and two until it was gone in the third
        "kept": 1,
        "weight": pytest.approx([(0.75 + 0.25) / 2, (0.5 + 0.5) / 2, 0.25 / 2, 0.125 / 2, 0.0]),
    }


def test_the_list_has_thirty_updates():
    there = belief((1.0, 0.0, 0.5))
    found = followed(made_drive([AT_ORIGIN] * 40), [there] * 40, [there, *[None] * 39])
    assert (found["weight"], found["updates"], found["kept"]) == ([0.5] * 30, 40.0, 1)


def test_updates_are_the_mean_over_all_hypotheses():
    stays, goes, both = belief((0.0, 9.0, 0.5)), belief((0.0, 5.0, 0.5)), belief((0.0, 5.0, 0.5), (0.0, 9.0, 0.5))
    found = followed(made_drive([AT_ORIGIN] * 4), [stays, both, both, stays], [stays, None, goes, goes])
    assert (found["updates"], found["kept"]) == (pytest.approx((4 + 1 + 0) / 3), 1)

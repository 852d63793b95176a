import numpy as np
import pytest
from small_run import collected

from omninav.pipeline import Context, Tick
from omninav.stages.metrics.false_hypothesis_duration import FalseHypothesisDuration
from omninav.stages.values.belief import GaussianMixture
from omninav.stages.values.pose import Motion, Pose

CTX = Context("metric")


@pytest.fixture(autouse=True)
def few_points(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("omninav.stages.metrics.false_hypothesis_duration.POINTS", 4)


def belief(*places: tuple[float, float, float]) -> GaussianMixture:
    """Components at x, y, with their weights."""
    means = np.array([[x, y, 0.0] for x, y, _ in places])
    return GaussianMixture(means, np.tile(np.eye(3), (len(places), 1, 1)), np.array([w for _, _, w in places]))


def followed(weights: list[float]):
    """A metre a frame along x; in frame 1 a wrong hypothesis 8 m beside, which then has these weights."""
    frames = len(weights) + 1
    truth = [Pose(float(n), 0.0, 0.0) for n in range(frames)]
    drive = collected(
        [Tick(n, n, 0, n, n == 0) for n in range(frames)], truth, [None, *[Motion(1.0, 0.0, 0.0)] * (frames - 1)]
    )
    there = [[(n + 1.0, 8.0, w)] if w else [] for n, w in enumerate(weights)]
    beliefs = [belief((0.0, 0.0, 1.0)), *(belief((n + 1.0, 0.0, 1.0), *each) for n, each in enumerate(there))]
    wrong = [None, belief((1.0, 8.0, 1.0)), *[None] * (frames - 2)]
    return FalseHypothesisDuration().step(CTX, drive, beliefs, wrong).metrics.values["wrong_hypotheses"]


def test_a_wrong_hypothesis_lives_until_the_belief_has_nothing_there():
    found = followed([0.5, 0.2, 0.05, 0.0, 0.0])
    assert (found["number"], found["updates"], found["kept"]) == (1, 3.0, 0)
    assert found["weight"] == pytest.approx([0.5, 0.2, 0.05, 0.0])


def test_one_that_stays_to_the_end_is_counted():
    found = followed([0.5, 0.5, 0.5])
    assert (found["updates"], found["kept"]) == (3.0, 1)
    assert found["weight"] == [0.5, 0.5, 0.5]  # it has not gone because the drive has ended


def test_a_component_that_comes_there_later_is_another():
    assert followed([0.5, 0.0, 0.3])["updates"] == 1.0


def test_without_wrong_hypotheses_there_is_nothing_to_measure():
    drive = collected([Tick(0, 0)], [Pose(0.0, 0.0, 0.0)])
    assert FalseHypothesisDuration().step(CTX, drive, [belief((0.0, 0.0, 1.0))], [None]).metrics is None


def test_hypotheses_are_followed_along_odometry_each_from_its_own_frame_and_figures_are_means(
    monkeypatch: pytest.MonkeyPatch,
):
    # The robot turns left by a right angle, then drives a metre; what was ahead of the first is followed in its frame.
    motion = [None, Motion(0.0, 0.0, np.pi / 2), Motion(2.0, 0.0, 0.0), Motion(2.0, 0.0, 0.0)]
    drive = collected([Tick(n, n) for n in range(4)], [Pose(0.0, 0.0, 0.0)] * 4, motion)
    one, other = belief((5.0, 0.0, 0.3), (50.0, 0.0, 0.9)), belief((-5.0, 0.0, 1.0))
    beliefs = [
        belief((5.0, 1.5, 0.25), (5.0, -1.5, 0.5), (5.0, 1.6, 9.0)),
        belief((5.0, 0.0, 0.5), (-5.0, 0.0, 0.25)),
        belief((5.0, 2.0, 0.25), (-3.0, 0.0, 0.5)),
        belief((5.0, 4.0, 0.125), (5.0, -4.0, 1.0)),
    ]
    monkeypatch.setattr("omninav.stages.metrics.false_hypothesis_duration.POINTS", 5)
    found = FalseHypothesisDuration().step(CTX, drive, beliefs, [one, other, None, None]).metrics.values
    assert found["wrong_hypotheses"] == {
        "number": 2,
        "updates": 3.0,  # four to the end, and two until it was gone in the third
        "kept": 1,
        "weight": pytest.approx([(0.75 + 0.25) / 2, (0.5 + 0.5) / 2, 0.25 / 2, 0.125 / 2, 0.0]),
    }


def test_the_list_has_thirty_updates(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.undo()
    drive = collected([Tick(n, n) for n in range(40)], [Pose(0.0, 0.0, 0.0)] * 40)
    there = belief((1.0, 0.0, 0.5))
    found = (
        FalseHypothesisDuration()
        .step(CTX, drive, [there] * 40, [there, *[None] * 39])
        .metrics.values["wrong_hypotheses"]
    )
    assert (found["weight"], found["updates"], found["kept"]) == ([0.5] * 30, 40.0, 1)


def test_updates_are_the_mean_over_all_hypotheses():
    drive = collected([Tick(n, n) for n in range(4)], [Pose(0.0, 0.0, 0.0)] * 4)
    stays, goes = belief((0.0, 9.0, 0.5)), belief((0.0, 5.0, 0.5))
    beliefs = [stays, belief((0.0, 5.0, 0.5), (0.0, 9.0, 0.5)), belief((0.0, 5.0, 0.5), (0.0, 9.0, 0.5)), stays]
    found = (
        FalseHypothesisDuration()
        .step(CTX, drive, beliefs, [stays, None, goes, goes])
        .metrics.values["wrong_hypotheses"]
    )
    assert (found["updates"], found["kept"]) == (pytest.approx((4 + 1 + 0) / 3), 1)

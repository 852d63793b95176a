import numpy as np
import pytest

from omninav.pipeline import Context, Tick
from omninav.stages.sensor.outside_estimator import OutsideEstimator, OutsideEstimatorState
from omninav.stages.values.pose import Pose


def statements(stage: OutsideEstimator, frames: int):
    """Along a line, half a metre a frame: each frame's true x and output."""
    ctx, state = Context("estimator", np.random.default_rng(1)), OutsideEstimatorState()
    found = []
    for n in range(frames):
        ctx.tick = Tick(n, n, 0, n, n == 0)
        found.append((0.5 * n, stage.step(ctx, Pose(0.5 * n, 0.0, 0.0), state)))
    return found


def test_it_states_the_pose_every_few_metres(monkeypatch):
    monkeypatch.setattr("omninav.stages.sensor.outside_estimator.EVERY_M", 2.0)
    stated = [x for x, out in statements(OutsideEstimator(), 13) if out.hypothesis is not None]
    assert stated == [0.0, 2.0, 4.0, 6.0]


def test_its_errors_are_as_large_as_it_says(monkeypatch):
    monkeypatch.setattr("omninav.stages.sensor.outside_estimator.EVERY_M", 0.4)
    found = [(x, out.hypothesis) for x, out in statements(OutsideEstimator(), 400)]
    gaps = np.array([hypothesis.means[0] - [x, 0.0, 0.0] for x, hypothesis in found])
    sigmas = np.sqrt(np.diag(found[0][1].covariances[0]))
    assert gaps.std(axis=0) == pytest.approx(sigmas, rel=0.12)
    assert sigmas == pytest.approx([0.3, 0.3, np.radians(10.0)])


def test_wrong_statements_lie_far_off_and_are_named(monkeypatch):
    monkeypatch.setattr("omninav.stages.sensor.outside_estimator.EVERY_M", 0.4)
    outs = statements(OutsideEstimator(wrong=0.25), 400)
    wrong = [(x, out.wrong.means[0]) for x, out in outs if out.wrong is not None]
    assert len(wrong) == pytest.approx(100, abs=25)
    assert np.mean([np.hypot(mean[0] - x, mean[1]) for x, mean in wrong]) == pytest.approx(8.0, abs=0.2)
    right = [(x, out.hypothesis.means[0]) for x, out in outs if out.wrong is None]
    assert max(np.hypot(mean[0] - x, mean[1]) for x, mean in right) < 2.0


def test_without_truth_it_states_nothing():
    ctx = Context("estimator", np.random.default_rng(1))
    assert OutsideEstimator().step(ctx, None, OutsideEstimatorState()).hypothesis is None

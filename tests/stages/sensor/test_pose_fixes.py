import numpy as np
import pytest

from omninav.pipeline import Context, Tick
from omninav.stages.sensor.pose_fixes import PoseFixes, PoseFixesState
from omninav.stages.values.pose import Pose

WAY = [Pose(0.25 * k, 0.0, 0.1) for k in range(13)]  # three metres in steps of 25 cm


def fixes(
    stage: PoseFixes, way: list[Pose | None] = WAY, log: int = 0, memory: PoseFixesState | None = None
) -> list[float]:
    """Where along the way there is a fix."""
    memory, found = memory or PoseFixesState(), []
    for k, pose in enumerate(way):
        ctx = Context("calibration")
        ctx.tick = Tick(k, k, log=log, frame=k, first_of_log=k == 0)
        hypothesis = stage.step(ctx, pose, memory).hypothesis
        if hypothesis is not None:
            found.append(float(hypothesis.means[0, 0]))
    return found


def test_each_picture_states_the_true_pose_with_the_given_sigmas() -> None:
    stage = PoseFixes(sigma_m=0.2, sigma_rad=0.1, weight=0.7)
    hypothesis = stage.step(Context("calibration"), Pose(1.0, 2.0, 3.0), PoseFixesState()).hypothesis
    assert hypothesis is not None
    assert hypothesis.means.tolist() == [[1.0, 2.0, 3.0]]
    assert hypothesis.covariances[0] == pytest.approx(np.diag([0.04, 0.04, 0.01]))
    assert hypothesis.weights.tolist() == [0.7]
    assert len(fixes(stage)) == len(WAY)


def test_every_metre_and_at_the_beginning_there_is_a_fix() -> None:
    assert fixes(PoseFixes(every_m=1.0)) == [0.0, 1.0, 2.0, 3.0]


def test_only_on_the_first_metres_of_each_log() -> None:
    memory = PoseFixesState()
    stage = PoseFixes(first_m=1.0, every_m=0.5)
    assert [fixes(stage, log=log, memory=memory) for log in range(2)] == [[0.0, 0.5, 1.0]] * 2


def test_without_truth_nothing_is_stated_and_it_is_counted() -> None:
    ctx = Context("calibration")
    assert PoseFixes().step(ctx, None, PoseFixesState()).hypothesis is None
    assert ctx.counts["image_without_true_pose"] == 1
    assert fixes(PoseFixes(every_m=1.0), [WAY[0], None, None, *WAY[5:8]]) == [0.0, 1.25]


def estimates(wrong: float) -> list[tuple[float, PoseFixes.Out]]:
    """Runs an external estimator along a line, half a metre an image: each image's true x, and the output."""
    stage = PoseFixes(every_m=0.4, sigma_m=0.3, sigma_rad=0.17, wrong=wrong)
    ctx, memory = Context("estimator", np.random.default_rng(1)), PoseFixesState()
    found = []
    for n in range(400):
        ctx.tick = Tick(n, n, 0, n, n == 0)
        found.append((0.5 * n, stage.step(ctx, Pose(0.5 * n, 0.0, 0.0), memory)))
    return found


def test_errors_of_an_estimator_are_as_large_as_stated() -> None:
    found = [(x, out.hypothesis) for x, out in estimates(wrong=0.0)]
    gaps = np.array([hypothesis.means[0] - [x, 0.0, 0.0] for x, hypothesis in found])
    sigmas = np.sqrt(np.diag(found[0][1].covariances[0]))
    assert gaps.std(axis=0) == pytest.approx(sigmas, rel=0.12)
    assert sigmas == pytest.approx([0.3, 0.3, 0.17])


def test_wrong_estimates_lie_far_off_and_are_named() -> None:
    outs = estimates(wrong=0.25)
    wrong = [(x, out.wrong.means[0]) for x, out in outs if out.wrong is not None]
    assert len(wrong) == pytest.approx(100, abs=25)
    assert np.mean([np.hypot(mean[0] - x, mean[1]) for x, mean in wrong]) == pytest.approx(8.0, abs=0.2)
    right = [(x, out.hypothesis.means[0]) for x, out in outs if out.wrong is None]
    assert max(np.hypot(mean[0] - x, mean[1]) for x, mean in right) < 2.0

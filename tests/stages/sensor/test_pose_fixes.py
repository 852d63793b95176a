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


def test_fixes_are_given_at_the_listed_places_only() -> None:
    assert fixes(PoseFixes(places=((1.0, 0.2), (9.0, 9.0)), radius_m=0.4)) == [0.75, 1.0, 1.25]
    assert fixes(PoseFixes(places=((2.0, 0.0),), radius_m=0.3, every_m=0.4)) == [1.75, 2.25]


def test_only_in_the_logs_that_are_named_and_anew_in_each() -> None:
    memory = PoseFixesState()
    stage = PoseFixes(logs=(0, 2), every_m=2.0)
    assert [fixes(stage, log=log, memory=memory) for log in range(3)] == [[0.0, 2.0], [], [0.0, 2.0]]


def test_only_on_the_first_metres_of_each_log() -> None:
    memory = PoseFixesState()
    stage = PoseFixes(first_m=1.0, every_m=0.5)
    assert [fixes(stage, log=log, memory=memory) for log in range(2)] == [[0.0, 0.5, 1.0]] * 2


def test_without_truth_nothing_is_stated_and_it_is_counted() -> None:
    ctx = Context("calibration")
    assert PoseFixes().step(ctx, None, PoseFixesState()).hypothesis is None
    assert ctx.counts["image_without_true_pose"] == 1
    assert fixes(PoseFixes(every_m=1.0), [WAY[0], None, None, *WAY[5:8]]) == [0.0, 1.25]

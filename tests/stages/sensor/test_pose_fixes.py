import numpy as np
import pytest

from omninav.pipeline import Context, Tick
from omninav.stages.sensor.pose_fixes import PoseFixes, Stated
from omninav.stages.values.pose import Pose

WAY = [Pose(0.25 * k, 0.0, 0.1) for k in range(13)]  # three metres in steps of 25 cm


def stated(stage: PoseFixes, way: list[Pose | None] = WAY, log: int = 0, memory: Stated | None = None) -> list[float]:
    """Where along the way a pose is stated."""
    memory, found = memory or Stated(), []
    for k, pose in enumerate(way):
        ctx = Context("calibration")
        ctx.tick = Tick(k, k, log=log, frame=k, first_of_log=k == 0)
        hypothesis = stage.step(ctx, pose, memory).hypothesis
        if hypothesis is not None:
            found.append(float(hypothesis.means[0, 0]))
    return found


def test_each_picture_states_the_true_pose_with_the_given_sigmas() -> None:
    stage = PoseFixes(sigma_m=0.2, sigma_rad=0.1, weight=0.7)
    hypothesis = stage.step(Context("calibration"), Pose(1.0, 2.0, 3.0), Stated()).hypothesis
    assert hypothesis is not None
    assert hypothesis.means.tolist() == [[1.0, 2.0, 3.0]]
    assert hypothesis.covariances[0] == pytest.approx(np.diag([0.04, 0.04, 0.01]))
    assert hypothesis.weights.tolist() == [0.7]
    assert len(stated(stage)) == len(WAY)


def test_every_metre_a_pose_is_stated_and_at_the_beginning() -> None:
    assert stated(PoseFixes(every_m=1.0)) == [0.0, 1.0, 2.0, 3.0]


def test_at_stated_places_only() -> None:
    assert stated(PoseFixes(places=((1.0, 0.2), (9.0, 9.0)), near_m=0.4)) == [0.75, 1.0, 1.25]
    assert stated(PoseFixes(places=((2.0, 0.0),), near_m=0.3, every_m=0.4)) == [1.75, 2.25]


def test_only_in_the_logs_that_are_named_and_anew_in_each() -> None:
    memory = Stated()
    stage = PoseFixes(logs=(0, 2), every_m=2.0)
    assert [stated(stage, log=log, memory=memory) for log in range(3)] == [[0.0, 2.0], [], [0.0, 2.0]]


def test_only_on_the_first_metres_of_each_log() -> None:
    memory = Stated()
    stage = PoseFixes(first_m=1.0, every_m=0.5)
    assert [stated(stage, log=log, memory=memory) for log in range(2)] == [[0.0, 0.5, 1.0]] * 2


def test_without_truth_nothing_is_stated_and_it_is_counted() -> None:
    ctx = Context("calibration")
    assert PoseFixes().step(ctx, None, Stated()).hypothesis is None
    assert ctx.counts["no_pose_to_state"] == 1
    assert stated(PoseFixes(every_m=1.0), [WAY[0], None, None, *WAY[5:8]]) == [0.0, 1.25]

import numpy as np
import pytest

from omninav.stages.geometry.plane.se2 import compose
from omninav.stages.metrics.map_frame import in_map_frame

MOTION = np.array([3.0, -2.0, 0.7])


@pytest.mark.parametrize("lost", [0, 40])
def test_true_poses_are_moved_to_where_most_estimates_are(lost: int) -> None:
    rng = np.random.default_rng(0)
    truth = np.column_stack([rng.uniform(-5, 5, (100, 2)), rng.uniform(-3, 3, 100)])
    right = compose(MOTION, truth)
    estimate = right + rng.normal(0.0, 0.001, (100, 3))
    estimate[:lost, :2] += rng.uniform(3, 9, (lost, 2))
    truth[50], estimate[60] = np.nan, np.nan
    moved = in_map_frame(truth, estimate)
    assert np.isnan(moved[50]).all()
    known = np.arange(100) != 50
    assert np.abs(moved[known] - right[known])[:, :2].max() < 0.01


def test_a_robot_that_stands_is_moved_with_its_heading() -> None:
    truth = np.tile([1.0, 2.0, 0.5], (5, 1))
    assert in_map_frame(truth, compose(MOTION, truth)) == pytest.approx(compose(MOTION, truth))


def test_without_any_estimate_nothing_is_moved() -> None:
    truth = np.zeros((3, 3))
    assert in_map_frame(truth, np.full((3, 3), np.nan)) is truth

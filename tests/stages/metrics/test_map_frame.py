import numpy as np
import pytest

from omninav.stages.geometry.plane.pose_errors import heading_errors_deg
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


@pytest.mark.parametrize("metres", [0.0, 0.05])
def test_the_headings_of_a_robot_that_hardly_moves_say_how_its_frame_is_turned(metres: float) -> None:
    rng = np.random.default_rng(0)
    truth = np.column_stack([np.linspace(0.0, metres, 100), np.zeros(100), np.linspace(0.0, 6.0, 100)])
    right, noise = compose(MOTION, truth), rng.normal(0.0, 1.0, (100, 3)) * [0.02, 0.02, 0.02]
    moved = in_map_frame(truth + rng.normal(0.0, 0.001, (100, 3)), right + noise)
    assert heading_errors_deg(moved, right).mean() < 0.5


def test_true_headings_that_are_all_turned_do_not_turn_the_positions_of_a_loop() -> None:
    around = np.linspace(0.0, 6.0, 100)
    truth = np.column_stack([10.0 * np.sin(around), -10.0 * np.cos(around), around])
    moved = in_map_frame(truth + np.array([0.0, 0.0, 1.57]), compose(MOTION, truth))
    assert np.abs((moved - compose(MOTION, truth))[:, :2]).max() < 0.01


def test_without_any_estimate_nothing_is_moved() -> None:
    truth = np.zeros((3, 3))
    assert in_map_frame(truth, np.full((3, 3), np.nan)) is truth

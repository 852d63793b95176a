import numpy as np
import pytest

from omninav.stages.source.log_parts import frozen_steps

AHEAD = np.column_stack([np.arange(20) * 0.2, np.zeros(20), np.zeros(20)])


def changed(poses: np.ndarray, rows: slice, x: float) -> np.ndarray:
    poses = poses.copy()
    poses[rows, 0] = x
    return poses


def test_odometry_that_stops_while_the_robot_goes_on_is_counted() -> None:
    steps, metres = frozen_steps(changed(AHEAD, slice(5, None), 1.0), AHEAD)
    assert (steps, metres) == (14, pytest.approx(2.8))
    assert frozen_steps(np.zeros((20, 3)), AHEAD)[0] == 19


@pytest.mark.parametrize(
    ("odometry", "truth"),
    [
        (AHEAD, AHEAD),
        (AHEAD * 0.0, AHEAD * 0.0),
        (AHEAD * 0.0, np.random.default_rng(0).normal(scale=0.02, size=(20, 3))),
        (AHEAD * 0.0, changed(AHEAD * 0.0, slice(10, None), 8.0)),
        (AHEAD * 0.0, np.full((20, 3), np.nan)),
        (AHEAD[:1], AHEAD[:1]),
    ],
    ids=["moves", "stands", "stands in noise", "is lifted", "no truth", "one image"],
)
def test_a_robot_that_moves_stands_or_is_lifted_is_not(odometry: np.ndarray, truth: np.ndarray) -> None:
    assert frozen_steps(odometry, truth) == (0, 0.0)

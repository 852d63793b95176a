import numpy as np
import pytest

from omninav.stages.geometry.plane.se2 import compose
from omninav.stages.source.cuts import thinned
from omninav.stages.source.log_parts import frozen_steps, odometry_scale, truth_excursion

AHEAD = np.column_stack([np.arange(20) * 0.2, np.zeros(20), np.zeros(20)])


def changed(poses: np.ndarray, rows: slice, x: float) -> np.ndarray:
    poses = poses.copy()
    poses[rows, 0] = x
    return poses


def moved(first: int, end: int, *by: float) -> np.ndarray:
    """The poses of some images somewhere else."""
    rows = np.arange(20)
    return AHEAD + ((rows >= first) & (rows < end))[:, None] * np.array(by)


@pytest.mark.parametrize("back_s", [15, 100])
def test_a_rate_counts_anew_where_a_clock_was_set_back(back_s: int) -> None:
    seconds = np.arange(400) / 10 - back_s * (np.arange(400) >= 200)
    stamps = np.round(seconds * 1e9).astype(np.int64) + 10**12
    assert thinned(np.arange(400), stamps, 2.0).tolist() == list(range(0, 400, 5))
    assert not len(thinned(np.arange(0), stamps, 2.0))


def test_odometry_that_stops_while_the_robot_goes_on_is_counted() -> None:
    steps, metres = frozen_steps(changed(AHEAD, slice(5, None), 1.0), AHEAD)
    assert (steps, metres) == (14, pytest.approx(2.8))
    assert frozen_steps(np.zeros((20, 3)), AHEAD)[0] == 19
    angles = np.linspace(0.0, 2.0 * np.pi, 20)
    circle = np.column_stack([np.sin(angles), np.cos(angles), -angles])
    assert frozen_steps(np.zeros((20, 3)), circle) == (19, pytest.approx(6.254, abs=1e-3))


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


FAR = np.column_stack([np.arange(200) * 0.2, np.zeros(200), np.zeros(200)])
NOISE = np.random.default_rng(1).normal(scale=0.05, size=(200, 3))


@pytest.mark.parametrize(
    ("odometry", "truth", "found"),
    [
        (10.0 * FAR, FAR + NOISE, 10.0),
        (0.001 * FAR, FAR + NOISE, 0.001),
        (0.9 * FAR, FAR + NOISE, None),
        (0.0 * FAR, NOISE, None),
        (FAR, FAR + (np.arange(200) > 90)[:, None] * 30.0, None),
        (FAR, np.where(np.arange(200)[:, None] < 100, FAR, np.nan), None),
        (0.0 * FAR, np.full((200, 3), np.nan), None),
    ],
    ids=["10 times", "mm", "slips", "stands in noise", "is carried", "truth ends", "no truth"],
)
def test_odometry_in_another_unit_than_truth_is_told(odometry: np.ndarray, truth: np.ndarray, found: float | None):
    assert odometry_scale(odometry, truth) == (found and pytest.approx(found, rel=0.05))


@pytest.mark.parametrize(
    ("truth", "found"),
    [
        (AHEAD, None),
        (compose(np.array([3.0, 1.0, 2.0]), AHEAD), None),
        (moved(8, 13, 0.0, 3.0, 0.5), (8, 12, 3.0)),
        (moved(8, 13, 0.0, 0.8, 0.0), None),
        (moved(8, 20, 0.0, 3.0, 0.0), None),
        (moved(8, 20, 0.0, 3.0, 0.0) + moved(13, 20, -4.0, -1.0, 0.0) - AHEAD, None),
        (np.full((20, 3), np.nan), None),
        (AHEAD[:0], None),
    ],
    ids=["fits", "other frame", "lost for a while", "by less", "carried", "carried twice", "no truth", "no image"],
)
def test_a_truth_that_leaves_odometry_and_comes_back_is_told(truth: np.ndarray, found: tuple | None) -> None:
    assert truth_excursion(AHEAD[: len(truth)], truth) == (found and pytest.approx(found, abs=0.01))

import numpy as np
import pytest

from omninav.stages.geometry.plane.se2 import between, compose, turned
from omninav.stages.geometry.plane.stamp_jitter import JITTERS_S, StampJitter

INTERVAL_S, SPEED, SIGMAS = 0.2, 0.4, np.array([0.002, 0.002, 0.0006])


def path(seconds: np.ndarray) -> np.ndarray:
    """Poses (N, 3) of a robot that swings from side to side at these times."""
    headings = 0.8 * np.sin(0.9 * seconds)
    x, y = np.cumsum(np.diff(seconds, prepend=0.0) * SPEED * np.array([np.cos(headings), np.sin(headings)]), axis=1)
    return np.column_stack([x, y, headings])


def judged(sigma_s: float, seed: int, images: int = 80, odometry: float = 0.02, poses: float = 1.0) -> StampJitter:
    """Jitter after so many images whose stamps jitter by `sigma_s`, with this part of odometry's motions wrong."""
    rng = np.random.default_rng(seed)
    fine = np.arange(-200, 100 * images) / 500.0
    along = path(fine)

    def at(seconds: np.ndarray) -> np.ndarray:
        return np.column_stack([np.interp(seconds, fine, column) for column in along.T])

    stamps = INTERVAL_S * np.arange(images)
    taken = at(stamps + rng.normal(0.0, sigma_s, images))
    seen = taken + rng.normal(0.0, 1.0, taken.shape) * SIGMAS * poses
    moved = between(at(stamps)[:-1], at(stamps)[1:]) * (1.0 + rng.normal(0.0, odometry, (images - 1, 1)))
    jitter = StampJitter.unknown()
    for pose, motion in zip(seen, np.concatenate([[[0.0] * 3], moved]), strict=True):
        jitter = jitter.seen(pose, np.diag((SIGMAS * poses) ** 2), motion, INTERVAL_S)
    return jitter


@pytest.mark.parametrize("sigma_s", [0.01, 0.02, 0.06])
def test_stamps_that_jitter_are_found_to_do_so_by_as_much(sigma_s: float) -> None:
    found = [np.sqrt(judged(sigma_s, seed).variance()) for seed in range(8)]
    assert min(found) > 0.5 * sigma_s
    assert np.mean(found) == pytest.approx(sigma_s, rel=0.3)


@pytest.mark.parametrize("odometry", [0.0, 0.05, 0.5])
def test_exact_stamps_show_none_however_wrong_odometry_is(odometry: float) -> None:
    found = [judged(0.0, seed, odometry=odometry).variance() for seed in range(8)]
    assert max(found) < 0.004**2


def test_inaccurate_poses_are_no_jitter() -> None:
    assert [judged(0.0, seed, poses=5.0).variance() for seed in range(8)] == [0.0] * 8


def test_a_robot_that_stands_tells_nothing_of_its_stamps() -> None:
    jitter, rng = StampJitter.unknown(), np.random.default_rng(0)
    for _ in range(40):
        jitter = jitter.seen(rng.normal(0.0, 0.002, 3), np.diag(SIGMAS**2), np.zeros(3), INTERVAL_S)
    assert not jitter.hypotheses.any()
    assert np.isnan(jitter.along).all()


def test_an_image_without_a_pose_interrupts_the_sequence() -> None:
    before = judged(0.04, 0)
    after = before.interrupted().seen(np.array([90.0, 0.0, 0.0]), np.diag(SIGMAS**2), np.array([0.1, 0.0, 0.0]), 0.2)
    assert (after.hypotheses == before.hypotheses).all()
    assert (after.pose == [90.0, 0.0, 0.0]).all()
    on = after.seen(np.array([90.1, 0.0, 0.0]), np.diag(SIGMAS**2), np.array([0.1, 0.0, 0.0]), 0.2)
    assert (on.hypotheses[2] > on.hypotheses[2, :, :1] - 1e-12).all()  # of one motion alone, whatever came before
    assert on.hypotheses[2, 0, 0] == pytest.approx(2.0 * 0.002**2 / 0.5**2 + 0.002**2)


def test_a_motion_that_is_wrong_by_far_counts_for_nothing() -> None:
    before = judged(0.0, 0)
    after = before.seen(compose(before.pose, [2.0, 0.0, 0.0]), np.diag(SIGMAS**2), np.array([0.1, 0.0, 0.0]), 0.2)
    assert (after.hypotheses == before.hypotheses).all()


def test_the_variance_is_what_the_likelihoods_expect() -> None:
    unknown = StampJitter.unknown()
    assert unknown.variance() == 0.0
    likelihood = np.full(unknown.hypotheses.shape, -50.0)
    likelihood[0, 3] = 0.0
    assert StampJitter(*unknown[:-1], likelihood).variance() == pytest.approx(JITTERS_S[3] ** 2)


def test_velocities_are_turned_into_the_map() -> None:
    found = turned(np.array([[1.0, 0.0, 0.3], [0.0, 2.0, 0.1]]), np.array([np.pi / 2, np.pi]))
    assert found == pytest.approx(np.array([[0.0, 1.0, 0.3], [0.0, -2.0, 0.1]]))

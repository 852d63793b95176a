from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import toeplitz
from scipy.stats import multivariate_normal

from omninav.stages.geometry.plane.se2 import between, compose, turned
from omninav.stages.sensor import stamp_jitter
from omninav.stages.sensor.stamp_jitter import JITTERS_S, StampJitter

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
    assert unknown.probability() == pytest.approx(0.1)
    likelihood = np.full(unknown.hypotheses.shape, -50.0)
    likelihood[0, 3] = 0.0
    assert replace(unknown, hypotheses=likelihood).variance() == pytest.approx(JITTERS_S[3] ** 2)


def test_velocities_are_turned_into_the_map() -> None:
    found = turned(np.array([[1.0, 0.0, 0.3], [0.0, 2.0, 0.1]]), np.array([np.pi / 2, np.pi]))
    assert found == pytest.approx(np.array([[0.0, 1.0, 0.3], [0.0, -2.0, 0.1]]))


def straight(offsets: list[float], speed: float = 0.5, sigma: float = 0.002) -> StampJitter:
    """Jitter after images of a robot that drives along x, each so many metres beyond where odometry leads."""
    jitter, step = StampJitter.unknown(), np.array([speed * INTERVAL_S, 0.0, 0.0])
    for k, offset in enumerate(offsets):
        jitter = jitter.seen(k * step + [offset, 0.0, 0.0], np.eye(3) * sigma**2, step, INTERVAL_S)
    return jitter


def test_likelihoods_are_those_of_a_gaussian_sequence_with_correlated_neighbours(monkeypatch) -> None:
    monkeypatch.setattr(stamp_jitter, "FORGOTTEN", 1.0)
    times, pose = np.array([0.01, -0.015, 0.012, -0.008]), (0.002 / 0.5) ** 2
    found = straight([0.0, *(0.5 * np.cumsum(times))]).hypotheses[0]
    jitters = 0.005 * np.array([0.0, 1, 2**0.5, 2, 8**0.5, 4, 32**0.5, 8, 128**0.5, 16, 512**0.5, 32])
    odometry = [0.002, 0.004, 0.008, 0.016, 0.032, 0.064, 0.128, 0.256]
    expected = [
        [
            multivariate_normal(cov=toeplitz([2 * pose + o**2 + 2 * j**2, -pose - j**2, 0.0, 0.0])).logpdf(times)
            for o in odometry
        ]
        for j in jitters
    ]
    assert found == pytest.approx(np.array(expected) + 2.0 * np.log(2.0 * np.pi))


def test_a_residual_counts_as_one_of_four_standard_deviations_at_most() -> None:
    _, off, variance = (hypotheses := straight([0.0, 0.2]).hypotheses)
    assert off == pytest.approx(0.4)
    assert off[0, 0] ** 2 > 17.0 * variance[0, 0]
    assert hypotheses[0, 0, 0] == pytest.approx(-0.5 * (np.log(variance[0, 0]) + 16.0))


@pytest.mark.parametrize(
    ("offset", "speed", "sigma", "tells"),
    [
        (0.0, 0.1, 0.002, True),
        (0.0, 0.1, 0.0022, False),  # a motion tells the time with 31 ms
        (0.24, 0.5, 0.002, True),
        (0.26, 0.5, 0.002, False),  # it is more than half a second off
    ],
)
def test_only_sure_and_plausible_motions_tell_a_time(offset: float, speed: float, sigma: float, tells: bool) -> None:
    assert straight([0.0, offset], speed, sigma).hypotheses.any() == tells


@pytest.mark.parametrize(("speed", "tells"), [(0.24, False), (0.26, True), (0.95, True), (1.05, False)])
def test_motions_of_very_different_speeds_do_not_share_an_error(speed: float, tells: bool) -> None:
    before = straight([0.0, 0.01])
    step = np.array([0.1, 0.0, 0.0])
    after = before.seen(compose(before.pose, step), np.eye(3) * 0.002**2, step, 0.1 / speed)
    assert (after.hypotheses != before.hypotheses).any() == tells


def test_the_velocity_is_that_of_the_middle_of_a_turning_motion() -> None:
    start, moved = np.array([1.0, 2.0, 3.0]), np.array([0.1, 0.0, 0.4])  # the heading passes 180 degrees
    before = StampJitter.unknown().seen(start, np.diag(SIGMAS**2), np.zeros(3), INTERVAL_S)
    after = before.seen(compose(start, moved), np.diag(SIGMAS**2), moved, INTERVAL_S)
    assert after.velocity == pytest.approx([0.5 * np.cos(3.2), 0.5 * np.sin(3.2), 2.0])
    assert after.hypotheses[0].any()
    assert after.hypotheses[1] == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize(("odds", "share"), [(33.0, 0.25), (17.5, 0.0)])  # of 0.25 and 0.15, with one in 110 before
def test_jitter_counts_from_a_fifth_of_probability_on(odds: float, share: float) -> None:
    likelihood = np.full(StampJitter.unknown().hypotheses.shape, -50.0)
    likelihood[0, 0, 2], likelihood[0, 5, 3] = 3.0, 3.0 + np.log(odds)
    for past in (0.0, -900.0, 900.0):  # of many images
        found = replace(StampJitter.unknown(), hypotheses=likelihood + past).variance()
        assert found == pytest.approx(share * 0.02**2, rel=1e-6)


def test_what_is_not_known_is_nan() -> None:
    for jitter in (StampJitter.unknown(), judged(0.04, 0).interrupted()):
        assert (jitter.pose.shape, jitter.along.shape, jitter.covariance.shape) == ((3,), (3,), (3, 3))
        assert np.isnan([*jitter.pose, *jitter.along]).all()

"""Which matches are right: of points whose place is known."""

import math

import numpy as np

from omninav.stages.metrics.true_matches import right_by_depth, right_by_epipolar

MOVED = (1.0, 0.5, 0.7)


def views(number: int = 200) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Bearings of points in two views and their distances: (N, 3), (N, 3), (N,), (N,)."""
    rng = np.random.default_rng(3)
    points = rng.uniform((-6.0, -6.0, -1.0), (6.0, 6.0, 2.0), (number, 3))
    cos, sin = math.cos(MOVED[2]), math.sin(MOVED[2])
    there = (points - (MOVED[0], MOVED[1], 0.0)) @ np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
    near, far = np.linalg.norm(points, axis=1), np.linalg.norm(there, axis=1)
    return points / near[:, None], there / far[:, None], near, far


def test_all_matches_of_a_point_with_itself_are_right() -> None:
    first, second, near, far = views()
    assert right_by_depth(first, second, near, far, MOVED, 1e-6).all()
    assert right_by_epipolar(first, second, MOVED, 1e-6).all()


def test_one_depth_is_enough_where_the_other_ray_passed_by() -> None:
    first, second, _, far = views()
    assert right_by_depth(first, second, np.full(len(first), 99.0), far, MOVED, 1e-6).all()


def test_depths_tell_nearly_every_wrong_match_and_planes_leave_some() -> None:
    first, second, near, far = views()
    wrong = np.roll(np.arange(len(first)), 7)
    by_depth = right_by_depth(first, second[wrong], near, far[wrong], MOVED, math.radians(2.0)).mean()
    by_plane = right_by_epipolar(first, second[wrong], MOVED, math.radians(1.0)).mean()
    assert by_depth <= 0.01
    assert by_depth < by_plane < 0.2


def test_what_would_meet_behind_is_wrong_and_what_is_far_away_is_not() -> None:
    def level(*azimuths: float) -> np.ndarray:
        return np.array([(math.cos(azimuth), math.sin(azimuth), 0.0) for azimuth in azimuths])

    forward = (1.0, 0.0, 0.0)  # things fall back as the robot drives past; half a turn more, and it looks from behind
    first, second = level(0.5, 0.5, -math.pi / 2, 0.5, 0.5), level(0.7, 0.3, math.pi / 2, 0.7 - math.pi, 0.495)
    assert right_by_epipolar(first, second, forward, 0.01).tolist() == [True, False, False, False, True]
    assert right_by_epipolar(level(0.5, 0.5), level(0.3, 0.31), (0.0, 0.0, 0.2), 0.005).tolist() == [True, False]

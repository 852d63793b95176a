import math

import numpy as np
import pytest

from omninav.stages.geometry.landmarks.triangulation import triangulated_tracks

LIMITS = {"miss": math.radians(0.7), "min_parallax": math.radians(1.5), "max_distance": 30.0}
CENTRES = np.array([[0.0, 0.0, 0.0], [1.0, 0.2, 0.0], [1.5, 1.0, 0.0], [0.3, 1.4, 0.0], [-0.8, 0.5, 0.0]])


def towards(points, centres=CENTRES):
    """Sightings of points (P, 3) from each centre: starts, centres, bearings."""
    rays = points[:, None] - centres
    bearings = (rays / np.linalg.norm(rays, axis=2, keepdims=True)).reshape(-1, 3)
    starts = np.arange(len(points) + 1) * len(centres)
    return starts, np.tile(centres, (len(points), 1)), bearings


@pytest.mark.parametrize("origin", [[0.0, 0.0, 0.0], [5e5, 5.4e6, 0.0]])
def test_points_are_where_all_bearings_meet(origin: list[float]) -> None:
    points = origin + np.random.default_rng(0).uniform([-5, -4, -1], [6, 3, 2], (50, 3))
    found = triangulated_tracks(*towards(points, origin + CENTRES), **LIMITS)
    assert np.abs(found.points - points).max() < 1e-5
    assert found.kept.all()


def test_parallax_is_the_largest_angle_between_bearings() -> None:
    centres = np.array([[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [1.0, 0.0, 0.0]])
    track = towards(np.array([[0.0, 2.0, 0.0]]), centres)
    for least, is_found in ((math.pi / 4 - 1e-6, True), (math.pi / 4 + 1e-6, False)):
        found = triangulated_tracks(*track, **{**LIMITS, "min_parallax": least})
        assert np.isfinite(found.points).all() == is_found


def test_a_bearing_of_something_else_is_dropped_and_does_not_bend_the_point() -> None:
    points = np.array([[4.0, 3.0, 1.0], [-3.0, 2.0, 0.5]])
    starts, centres, bearings = towards(points)
    bearings[1] += [0.0, 0.0, 0.04]  # two degrees too high
    bearings[1] /= np.linalg.norm(bearings[1])
    found = triangulated_tracks(starts, centres, bearings, **LIMITS)
    assert found.points == pytest.approx(points, abs=1e-5)
    assert np.flatnonzero(~found.kept).tolist() == [1]


@pytest.mark.parametrize(
    ("point", "centres", "sign"),
    [
        ([20.0, 0.0, 0.0], [[0.0, 0.0, 0.0], [0.0, 0.4, 0.0]], 1),  # hardly any parallax
        ([0.0, 31.0, 0.0], [[0.0, 0.0, 0.0], [9.0, 0.0, 0.0]], 1),  # too far away
        ([3.0, 2.0, 0.0], [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]], -1),  # behind both
        ([3.0, 2.0, 0.0], [[0.0, 0.0, 0.0]], 1),  # seen once
        ([3.0, np.nan, 0.0], [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]], 1),
    ],
)
def test_there_is_no_point_where_nothing_tells_its_depth(point, centres, sign) -> None:
    good = np.array([3.0, 2.0, 0.0])
    starts, seen_from, bearings = towards(np.array([point]), np.array(centres))
    _, others, sure = towards(good[None])
    found = triangulated_tracks(
        np.append(starts, starts[-1] + len(others)),
        np.concatenate([seen_from, others]),
        np.concatenate([sign * bearings, sure]),
        **LIMITS,
    )
    assert np.isnan(found.points[0]).all()
    assert found.points[1] == pytest.approx(good, abs=1e-5)
    assert found.kept.tolist() == [False] * len(centres) + [True] * len(others)


def test_without_tracks_there_are_no_points() -> None:
    found = triangulated_tracks(np.zeros(1, np.int64), np.empty((0, 3)), np.empty((0, 3)), **LIMITS)
    assert found.points.shape == (0, 3)
    assert found.kept.shape == (0,)

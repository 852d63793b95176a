import numpy as np
import pytest

from omninav.stages.geometry.landmarks.floor import floor_depth, lowest_plane

POSES = np.array([[5.0, 2.5, 0.0], [50.0, 0.0, 0.0]])


def landmarks(rng, floor, walls=3000, on_floor=400):
    heights = np.concatenate([rng.uniform(-0.9, 1.5, walls), rng.normal(-floor, 0.02, on_floor)])
    return np.column_stack([rng.uniform([4.0, 1.5], [6.0, 3.5], (len(heights), 2)), heights])


def depth(points, height=0.9, scale=1.0, seen_by=0):
    seen = np.broadcast_to(seen_by, len(points))
    return floor_depth(points * scale, POSES * scale, seen, np.arange(len(points)), height)


@pytest.mark.parametrize("floor", [0.83, 0.9, 0.96])
def test_the_floor_is_the_depth_of_most_landmarks(floor):
    assert depth(landmarks(np.random.default_rng(0), floor)) == pytest.approx(floor, abs=0.006)


def test_a_map_of_another_unit_has_the_same_floor():
    points = landmarks(np.random.default_rng(0), 0.94)
    assert depth(points, height=9.0, scale=10.0) == pytest.approx(10.0 * depth(points))


@pytest.mark.parametrize(
    ("floor", "walls", "on_floor"), [(0.9, 3000, 0), (0.9, 3000, 40), (0.9, 0, 30), (0.9, 0, 0), (0.5, 3000, 400)]
)
def test_a_floor_that_does_not_stand_out_or_is_far_from_the_cameras_height_is_not_found(floor, walls, on_floor):
    assert depth(landmarks(np.random.default_rng(0), floor, walls, on_floor)) is None


def test_landmarks_that_are_seen_from_far_away_alone_do_not_count():
    wrong = landmarks(np.random.default_rng(0), 0.85, on_floor=800)
    right = landmarks(np.random.default_rng(1), 0.95)
    seen_by = np.repeat([1, 0], [len(wrong), len(right)])
    assert depth(np.concatenate([wrong, right]), seen_by=seen_by) == pytest.approx(0.95, abs=0.006)


@pytest.mark.parametrize("scale", [0.2, 1.0, 7.0])
def test_the_lowest_plane_is_the_floor_in_any_unit(scale):
    desk = landmarks(np.random.default_rng(1), 0.4, walls=0, on_floor=2400)  # denser than the floor
    points = np.concatenate([landmarks(np.random.default_rng(0), 0.9, walls=1000), desk]) * scale
    seen = np.zeros(len(points), np.int64)
    assert lowest_plane(points, POSES * scale, seen, np.arange(len(points))) == pytest.approx(0.9 * scale, rel=0.02)
    assert lowest_plane(points[:30], POSES * scale, seen[:30], np.arange(30)) is None


def test_what_a_polished_floor_mirrors_is_not_the_floor():
    mirrored = landmarks(np.random.default_rng(1), 2.5, walls=0, on_floor=200)
    points = np.concatenate([landmarks(np.random.default_rng(0), 0.9, walls=1000), mirrored])
    found = lowest_plane(points, POSES, np.zeros(len(points), np.int64), np.arange(len(points)))
    assert found == pytest.approx(0.9, rel=0.02)

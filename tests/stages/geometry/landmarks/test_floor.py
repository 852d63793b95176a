import numpy as np
import pytest

from omninav.stages.geometry.landmarks.floor import floor_depth


def landmarks(rng, floor, walls=3000, on_floor=400):
    heights = np.concatenate([rng.uniform(-0.9, 1.5, walls), rng.normal(-floor, 0.02, on_floor)])
    return np.column_stack([rng.uniform(0.0, 10.0, (len(heights), 2)), heights])


@pytest.mark.parametrize("floor", [0.83, 0.9, 0.96])
def test_the_floor_is_the_depth_of_most_landmarks(floor):
    assert floor_depth(landmarks(np.random.default_rng(0), floor), 0.9) == pytest.approx(floor, abs=0.006)


def test_a_map_of_another_unit_has_the_same_floor():
    points = landmarks(np.random.default_rng(0), 0.94)
    depth = floor_depth(points, 0.9)
    assert depth is not None
    assert floor_depth(10.0 * points, 9.0) == pytest.approx(10.0 * depth)


@pytest.mark.parametrize(("walls", "on_floor"), [(3000, 0), (3000, 40), (0, 30), (0, 0)])
def test_a_floor_that_does_not_stand_out_is_not_found(walls, on_floor):
    assert floor_depth(landmarks(np.random.default_rng(0), 0.9, walls, on_floor), 0.9) is None


def test_a_plane_far_from_the_cameras_height_is_no_floor():
    assert floor_depth(landmarks(np.random.default_rng(0), 0.5), 0.9) is None

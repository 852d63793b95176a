import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from omninav.stages.geometry.plane.point_cells import distinct, have_a_point_within, sort_into_cells, within


def gaps(points: np.ndarray, places: np.ndarray) -> np.ndarray:
    return np.hypot(*(places[:, None] - points).transpose(2, 0, 1))


@given(st.integers(0, 10_000), st.floats(0.1, 20.0))
def test_points_and_places_near_each_other_are_found(seed: int, radius: float) -> None:
    rng = np.random.default_rng(seed)
    points, places = rng.normal(0, 10, (60, 2)), rng.normal(0, 15, (20, 2))
    cells, gap = sort_into_cells(points, radius), gaps(points, places)
    near = within(cells, places, radius)
    assert set(np.flatnonzero((gap <= radius).any(axis=0))) <= set(near)
    assert gap.min(axis=0)[near].max(initial=0.0) <= 1.36 * radius
    assert np.array_equal(have_a_point_within(cells, places, radius), (gap < radius).any(axis=1))


@pytest.mark.parametrize("numbers", [[], [3], [5, -2, 5, 5, 0, -2]])
def test_each_number_is_given_once(numbers: list[int]) -> None:
    assert distinct(np.array(numbers, np.int64)).tolist() == sorted(set(numbers))

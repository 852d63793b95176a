"""Vectors and rotations inside compiled loops, beside numpy's and scipy's."""

import numpy as np
import numpy.typing as npt
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from omninav.stages.geometry.probability.small_systems import rotated_by, solve, unit

VECTORS = st.lists(st.floats(-5, 5), min_size=3, max_size=3).map(np.array)
Array = npt.NDArray[np.float64]


@given(VECTORS.filter(lambda vector: np.linalg.norm(vector) > 1e-3))
def test_a_unit_vector_has_length_one_and_the_same_direction(vector: Array):
    np.testing.assert_allclose(unit(vector) * np.linalg.norm(vector), vector, atol=1e-12)


@given(VECTORS, VECTORS)
def test_a_rotation_is_turned_further_as_scipy_does(first: Array, second: Array):
    """In the frame that it leads to, so the new one stands on the left."""
    start = Rotation.from_rotvec(first)
    expected = (Rotation.from_rotvec(second) * start).as_matrix()
    np.testing.assert_allclose(rotated_by(start.as_matrix(), *second.tolist()), expected, atol=1e-9)


def test_no_rotation_gives_a_copy_of_its_own():
    start = np.eye(3)
    same = rotated_by(start, 0.0, 0.0, 0.0)
    same[0, 0] = 5.0
    assert start[0, 0] == 1.0


@given(st.integers(1, 6), st.integers(0, 1000))
def test_a_definite_system_is_solved_as_numpy_does(size: int, seed: int):
    rng = np.random.default_rng(seed)
    half, right = rng.normal(size=(size, size)), rng.normal(size=size)
    matrix = half @ half.T + 0.1 * np.eye(size)
    np.testing.assert_allclose(solve(matrix, right), np.linalg.solve(matrix, right), rtol=1e-8, atol=1e-8)


def test_a_system_that_is_not_definite_gives_no_step():
    np.testing.assert_array_equal(solve(np.zeros((3, 3)), np.ones(3)), np.zeros(3))
    np.testing.assert_array_equal(solve(np.diag([1.0, -1.0]), np.ones(2)), np.zeros(2))

"""Arrays that grow row by row."""

import numpy as np

from omninav.stages.values.growable_arrays import GrowableArrays


class Rows(GrowableArrays):
    def __init__(self) -> None:
        self.rows = np.arange(6.0).reshape(2, 3)


def test_appended_rows_follow_in_order_behind_those_that_were_there():
    grown = Rows()
    for number in range(500):
        grown.append("rows", np.full(3, number))
    np.testing.assert_array_equal(grown.rows[:2], [[0, 1, 2], [3, 4, 5]])
    np.testing.assert_array_equal(grown.rows[2:, 0], np.arange(500))


def test_memory_is_moved_seldom():
    grown, addresses = Rows(), set()
    for number in range(1000):
        grown.append("rows", np.full(3, number))
        addresses.add(grown.rows.ctypes.data)
    assert len(addresses) < 10


def test_a_field_that_was_replaced_grows_from_its_new_rows():
    grown = Rows()
    grown.append("rows", np.zeros(3))
    grown.put(rows=np.ones((1, 3)))
    grown.append("rows", np.full(3, 2.0))
    np.testing.assert_array_equal(grown.rows, [[1, 1, 1], [2, 2, 2]])

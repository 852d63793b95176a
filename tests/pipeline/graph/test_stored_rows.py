"""Rows that are read where they are needed are those of the array, and no others are read."""

from typing import Any

import numpy as np
import pytest

from omninav.pipeline.graph import stored_rows
from omninav.pipeline.graph.stored_rows import FileRows, GatheredRows

ARRAY = np.arange(36, dtype=np.float32).reshape(9, 2, 2)
READ = [
    (slice(2, 8, 3), [2, 5]),
    (-1, [8]),
    ([3, 4, 8, 0, 4], [0, 3, 4, 8]),
    (np.array([[1, 2], [3, -5]]), [1, 2, 3, 4]),
    (np.arange(9) % 4 == 1, [1, 5]),
    ((slice(3), 1, 0), [0, 1, 2]),
    ([], []),
]
"""Indices, and the rows that each needs."""


@pytest.mark.parametrize("step", [16, 40, 1 << 22])
def test_an_index_reads_its_rows_once_and_in_order(monkeypatch: pytest.MonkeyPatch, step: int) -> None:
    monkeypatch.setattr(stored_rows, "_STEP", step)
    read: list[int] = []

    def content(first: np.ndarray, last: np.ndarray) -> bytearray:
        rows = [row for a, b in zip(first, last, strict=True) for row in range(a, b)]
        assert len(rows) <= max(1, step // 16)  # bytes of a row
        read.extend(rows)
        return bytearray(ARRAY[rows].tobytes())

    for index, needed in READ:
        rows: Any = FileRows(ARRAY.shape, ARRAY.dtype, content)
        assert (rows[index].shape, rows[index].tolist()) == (ARRAY[index].shape, ARRAY[index].tolist())
        assert [read.pop(0) for _ in range(2 * len(needed))] == 2 * needed
        parts = GatheredRows([(ARRAY, np.array([2, 0])), (rows, np.array([8, 7, 1, 5])), (ARRAY, np.arange(3))])
        assert np.array_equal(parts[index], ARRAY[[2, 0, 8, 7, 1, 5, 0, 1, 2]][index])
        assert (parts.dtype, parts.shape, parts.nbytes, len(parts)) == (np.float32, (9, 2, 2), 144, 9)
        read.clear()
    for wrong, said in (([0, 9], "no row 9, of 9"), ([-10, 8], "no row -10"), (9, "no row 9"), ([True], "a mask of")):
        with pytest.raises(IndexError, match=said):
            rows[wrong]

"""Rows of an array that lie in a file, for arrays that are larger than memory."""

import math
from collections.abc import Callable, Sequence
from typing import Any, Generic, TypeVar

import numpy as np
import numpy.typing as npt

T = TypeVar("T", bound=np.generic)


class StoredRows(Generic[T]):
    """An array in a file: `rows[…]` reads what it names, and checks it where it has not been read before.

    Whatever numpy takes as an index may stand there; the first index picks rows. What is given is a plain array that
    cannot be written to, or a copy. `np.asarray(rows)` reads everything. Raises BadInput naming file, array and chunk
    where what is read is damaged.
    """

    def __init__(self, array: npt.NDArray[T], check: Callable[[npt.NDArray[np.int64]], None]) -> None:
        """`array`: mapped into memory, not checked. `check`: raises BadInput where one of these rows is damaged."""
        self._array, self._check = array, check

    @property
    def shape(self) -> tuple[int, ...]:
        """As of the array."""
        return self._array.shape

    @property
    def dtype(self) -> np.dtype[T]:
        """As of the array."""
        return self._array.dtype

    @property
    def ndim(self) -> int:
        """As of the array."""
        return len(self.shape)

    @property
    def nbytes(self) -> int:
        """Bytes of the whole array, read or not."""
        return math.prod(self.shape) * self.dtype.itemsize

    def __len__(self) -> int:
        return self.shape[0]

    def __getitem__(self, index: Any) -> npt.NDArray[T]:
        self._check(self._rows(index[0] if isinstance(index, tuple) and index else index))
        return np.asarray(self._array[index])

    def __array__(self, dtype: npt.DTypeLike | None = None, copy: bool | None = None) -> npt.NDArray[Any]:
        return np.array(self[:], dtype, copy=True) if copy or dtype not in (None, self.dtype) else self[:]

    def __repr__(self) -> str:
        return f"<{self.dtype} of {self.shape}, in a file>"

    def _rows(self, index: Any) -> npt.NDArray[np.int64]:
        """The numbers of the rows that an index names. Raises IndexError where there is no such row."""
        count = len(self)
        if isinstance(index, slice) or index is None or index is Ellipsis:
            return np.arange(*(index if isinstance(index, slice) else slice(None)).indices(count))
        rows = np.asarray(index)
        if rows.dtype == bool:
            return np.flatnonzero(rows if rows.ndim <= 1 else rows.reshape(len(rows), -1).any(axis=1))
        if rows.size and not (int(rows.min()) >= -count and int(rows.max()) < count):
            raise IndexError(f"there is no row {rows.max() if rows.max() >= count else rows.min()}, of {count}")
        return np.asarray(np.where(rows < 0, rows + count, rows).ravel(), np.int64)


class GatheredRows(StoredRows[T]):
    """Some rows of some arrays, one after the other: gathered where they are needed, as when they are written."""

    def __init__(self, parts: Sequence[tuple[npt.NDArray[T] | StoredRows[T], npt.NDArray[np.int64]]]) -> None:
        """`parts`: an array and the numbers of its rows. All arrays are of one type, and their rows of one shape."""
        self._parts = parts
        self._starts = np.cumsum([0, *(len(rows) for _, rows in parts)])

    @property
    def shape(self) -> tuple[int, ...]:
        """As of one array of these rows."""
        return (int(self._starts[-1]), *self._parts[0][0].shape[1:])

    @property
    def dtype(self) -> np.dtype[T]:
        """As of the arrays."""
        return self._parts[0][0].dtype

    def __getitem__(self, index: Any) -> npt.NDArray[T]:
        first, *more = index if isinstance(index, tuple) else (index,)
        rows = self._rows(first)
        found = np.empty((len(rows), *self.shape[1:]), self.dtype)
        for (array, chosen), start in zip(self._parts, self._starts[:-1], strict=True):
            own = (rows >= start) & (rows < start + len(chosen))
            found[own] = array[chosen[rows[own] - start]]
        return found[(0 if isinstance(first, int | np.integer) else slice(None), *more)]

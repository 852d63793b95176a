"""Rows of an array that are in a file, for arrays that are larger than memory."""

import math
from abc import abstractmethod
from collections.abc import Callable, Sequence
from typing import Any, Generic, TypeVar

import numpy as np
import numpy.typing as npt

T = TypeVar("T", bound=np.generic)
Rows = npt.NDArray[np.int64]

_STEP = 1 << 22
"""About how many bytes are read at once."""


class StoredRows(Generic[T]):
    """An array whose `rows[…]` reads only the part that is indexed.

    It takes any index that numpy takes; the first index picks rows. The result is a copy.
    `np.asarray(rows)` reads everything.
    """

    shape: tuple[int, ...]
    dtype: np.dtype[T]

    @abstractmethod
    def _gathered(self, rows: Rows) -> npt.NDArray[T]:
        """Some rows (N,), by their numbers."""

    @property
    def nbytes(self) -> int:
        """Bytes of the whole array, read or not."""
        return math.prod(self.shape) * self.dtype.itemsize

    def __len__(self) -> int:
        return self.shape[0]

    def __getitem__(self, index: Any) -> npt.NDArray[T]:
        first, *more = index if isinstance(index, tuple) else (index,)
        found = self._gathered(self._numbers(first))
        if isinstance(first, np.ndarray | list) and np.ndim(first) > 1 and np.asarray(first).dtype != bool:
            found = found.reshape(*np.shape(first), *self.shape[1:])
        return found[(0 if isinstance(first, int | np.integer) else slice(None), *more)]

    def __array__(self, dtype: npt.DTypeLike | None = None, copy: bool | None = None) -> npt.NDArray[Any]:
        return self[:].astype(dtype or self.dtype, copy=False)

    def __repr__(self) -> str:
        return f"<{self.dtype} of {self.shape}, read where it is needed>"

    def _numbers(self, index: Any) -> Rows:
        """The numbers of the rows that an index names. Raises IndexError where there is no such row."""
        count = len(self)
        if isinstance(index, slice) or index is Ellipsis:
            return np.arange(*(index if isinstance(index, slice) else slice(None)).indices(count))
        rows = np.asarray(index)
        if rows.dtype == bool:
            if rows.shape != (count,):
                raise IndexError(f"a mask of the shape {rows.shape}, expected ({count},)")
            return np.flatnonzero(rows)
        if rows.size and not (int(rows.min()) >= -count and int(rows.max()) < count):
            raise IndexError(f"there is no row {rows.max() if rows.max() >= count else rows.min()}, of {count}")
        return np.asarray(np.where(rows < 0, rows + count, rows).ravel(), np.int64)


class FileRows(StoredRows[T]):
    """Rows in a file. Raises what `read` raises: `BadInput` where what is read is damaged."""

    def __init__(self, shape: tuple[int, ...], dtype: np.dtype[T], read: Callable[[Rows, Rows], bytearray]) -> None:
        """`read`: gives the bytes of runs of rows, each from a first to before a last (N,), one after the other."""
        self.shape, self.dtype, self._read = shape, dtype, read

    def _gathered(self, rows: Rows) -> npt.NDArray[T]:
        if (np.diff(rows) <= 0).any():
            rows, back = np.unique(rows, return_inverse=True)
            return self._gathered(rows)[back]
        found = np.empty((len(rows), *self.shape[1:]), self.dtype)
        block = max(1, _STEP * len(self) // max(self.nbytes, 1))
        for at in range(0, len(rows), block):
            some = rows[at : at + block]
            runs = np.flatnonzero(np.diff(some) != 1) + 1
            content = self._read(some[np.append(0, runs)], some[np.append(runs, len(some)) - 1] + 1)
            found[at : at + block] = np.frombuffer(content, self.dtype).reshape(len(some), *self.shape[1:])
        return found


class GatheredRows(StoredRows[T]):
    """Some rows of some arrays, one after the other: gathered where they are needed, as when they are written."""

    def __init__(self, parts: Sequence[tuple[npt.NDArray[T] | StoredRows[T], Rows]]) -> None:
        """`parts`: an array and the numbers of its rows. All arrays are of one type, and their rows of one shape."""
        self._parts = parts
        self._starts = np.cumsum([0, *(len(rows) for _, rows in parts)])
        self.shape, self.dtype = (int(self._starts[-1]), *parts[0][0].shape[1:]), parts[0][0].dtype

    def _gathered(self, rows: Rows) -> npt.NDArray[T]:
        found = np.empty((len(rows), *self.shape[1:]), self.dtype)
        for (array, chosen), start in zip(self._parts, self._starts[:-1], strict=True):
            own = (rows >= start) & (rows < start + len(chosen))
            found[own] = array[chosen[rows[own] - start]]
        return found

"""Header section of an artifact file: raw arrays with checksums per chunk, read on demand."""

import hashlib
import io
import math
import os
import weakref
import zipfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
import numpy.typing as npt

from omninav.pipeline.graph.contents import MAX_MAGNITUDE
from omninav.pipeline.graph.problems import BadInput
from omninav.pipeline.graph.stored_rows import FileRows, StoredRows

CHUNK = 1 << 16
"""Bytes with one sum: what is read, and checked, for a row that has not been read."""
IN_MEMORY = 1 << 26
"""Bytes of an array up to which it is read whole when its file is opened."""
ALIGNED = 64
"""An array's bytes begin at a multiple of this in the file."""
SUM = 32
"""Bytes of a chunk's sum (sha256)."""
_NPY_HEAD, _PAD, _STEP = 1 << 16, 0xD935, 1 << 20
_EMPTY_ROWS = 1 << 24
"""Rows that an array without any bytes may have: a loop over its rows ends."""


Ints = npt.NDArray[np.int64]


class Unfit(Exception):
    """Fault of an artifact's content, without its file's name."""


def parse_npy_head(head: io.BytesIO, length: int) -> tuple[tuple[int, ...], np.dtype[Any]]:
    """Shape and type that the head of a `.npy` states, for `length` bytes of head and array. Raises `Unfit`."""
    if np.lib.format.read_magic(head) != (1, 0):
        raise Unfit("an array is in another format than 1.0")
    shape, by_column, dtype = np.lib.format.read_array_header_1_0(head)
    left = length - head.tell()
    if dtype.hasobject or by_column or min(shape, default=0) < 0 or math.prod(shape) * dtype.itemsize != left:
        raise Unfit("an array is not as long as it states")
    if not left and max(shape, default=0) > _EMPTY_ROWS:
        raise Unfit(f"an array of nothing has {max(shape)} rows")
    return shape, dtype


def write_npy(member: Any, array: npt.NDArray[Any] | StoredRows[Any]) -> None:
    """Write an array as `.npy`, piece by piece."""
    head = {"descr": np.lib.format.dtype_to_descr(array.dtype), "fortran_order": False, "shape": array.shape}
    np.lib.format.write_array_header_1_0(member, head)
    rows = max(1, _STEP * len(array) // max(array.nbytes, 1))
    for start in range(0, len(array), rows):
        member.write(np.ascontiguousarray(array[start : start + rows]).reshape(-1).view(np.uint8).data)


def write_front(archive: zipfile.ZipFile, arrays: Mapping[str, npt.NDArray[Any] | StoredRows[Any]]) -> int:
    """Write arrays uncompressed and aligned as the first files of a zip; where they end."""
    for name, array in sorted(arrays.items()):
        entry = zipfile.ZipInfo(f"{name}.npy")
        entry.file_size = array.nbytes + _NPY_HEAD
        wide = 20 if entry.file_size * 1.05 > zipfile.ZIP64_LIMIT else 0  # zipfile's own extra field
        begin = archive.start_dir + 30 + len(entry.filename) + wide + 4
        entry.extra = _PAD.to_bytes(2, "little") + (-begin % ALIGNED).to_bytes(2, "little") + bytes(-begin % ALIGNED)
        with archive.open(entry, "w") as member:
            write_npy(member, array)
    return archive.start_dir


def sums_of(file: BinaryIO, end: int) -> npt.NDArray[np.uint8]:
    """The sums of the chunks of a file's first `end` bytes: (chunks, SUM)."""
    file.seek(0)
    sums = [hashlib.sha256(file.read(min(CHUNK, end - at))).digest() for at in range(0, end, CHUNK)]
    return np.frombuffer(b"".join(sums), np.uint8).reshape(-1, SUM)


class Front:
    """The front of an artifact file, which stays open. Each chunk is checked before anything in it is used.

    It is read, not mapped into memory: mapped pages count as the process's own, megabytes for a row of some kilobytes,
    and a process that touches one behind the end of a file that was cut is killed.
    """

    def __init__(self, path: Path, end: int, sums: npt.NDArray[np.uint8]) -> None:
        """`end`: where the front ends. Raises `Unfit` where the sums are not those of that many bytes."""
        if sums.dtype != np.uint8 or sums.shape != (-(-end // CHUNK), SUM):
            raise Unfit(f"its front of {end} bytes has sums of the shape {sums.shape!s:.40}")
        self.path, self._sums, self._end = path, sums, end
        self._file = os.open(path, os.O_RDONLY)
        weakref.finalize(self, os.close, self._file)
        self._checked = np.zeros(len(sums), bool)

    def array(self, entry: zipfile.ZipInfo, whole: bool) -> npt.NDArray[Any] | StoredRows[Any]:
        """An array of the front; all of it in memory where it is to be `whole`, or is small.

        Raises `BadInput` where a chunk that is read is damaged, and `Unfit` where the file in the zip is no array.
        """
        name, size = entry.filename.removesuffix(".npy"), entry.file_size
        local = self._read(entry.header_offset, 30, name)
        begin = entry.header_offset + 30 + sum(int.from_bytes(local[at : at + 2], "little") for at in (26, 28))
        if entry.compress_type != zipfile.ZIP_STORED or len(local) < 30 or begin + size > self._end:
            raise Unfit(f"the array '{name:.40}' is not at its front")
        head = io.BytesIO(self._read(begin, min(size, _NPY_HEAD), name))
        shape, dtype = parse_npy_head(head, size)
        begin, size = begin + head.tell(), size - head.tell()
        if not whole and size > IN_MEMORY and shape:
            return FileRows(shape, dtype, self._row_reader(name, begin, size // shape[0], dtype))
        array = np.empty(shape, dtype)
        flat = array.reshape(-1).view(np.uint8) if size else np.empty(0, np.uint8)
        for at in range(0, size, _STEP):
            flat[at : at + _STEP] = np.frombuffer(self._read(begin + at, min(_STEP, size - at), name), np.uint8)
        return array

    def _row_reader(self, name: str, begin: int, width: int, dtype: np.dtype[Any]) -> Callable[[Ints, Ints], bytearray]:
        def read(first: Ints, last: Ints) -> bytearray:
            content = self._read_runs(begin + first * width, begin + last * width, name)
            if dtype.kind == "f" and not _are_finite(np.frombuffer(content, dtype)):
                rows = f"rows {first[0]} to {last[-1] - 1} of the array '{name:.40}'"
                raise BadInput(f"{self.path}: {rows} hold numbers that are not finite; make it again")
            return content

        return read

    def _read(self, begin: int, size: int, name: str) -> bytearray:
        """Bytes of the front, checked; as many as there are."""
        begin, end = max(begin, 0), min(begin + size, self._end)
        return self._read_runs(np.array([begin]), np.array([end]), name) if begin < end else bytearray()

    def _read_runs(self, begin: Ints, end: Ints, name: str) -> bytearray:
        """The bytes of some runs, each from `begin` to before `end`, checked."""
        first, last = begin // CHUNK, (end - 1) // CHUNK
        chunks = np.minimum(first[:, None] + np.arange(int((last - first).max()) + 1), last[:, None])
        for chunk in np.unique(chunks[~self._checked[chunks]]).tolist():
            start = chunk * CHUNK
            content = os.pread(self._file, min(CHUNK, self._end - start), start)
            if hashlib.sha256(content).digest() != self._sums[chunk].tobytes():
                where = f"chunk {chunk} of the array '{name:.40}' (from byte {start})"
                raise BadInput(f"{self.path}: {where} is damaged, its sha256 differs; make it again")
            self._checked[chunk] = True
        sizes = end - begin
        file, read = self._file, os.pread
        found = bytearray().join(
            [read(file, size, at) for size, at in zip(sizes.tolist(), begin.tolist(), strict=True)]
        )
        if len(found) != int(sizes.sum()):
            raise BadInput(f"{self.path}: cut off while it was read; make it again")
        return found


def _are_finite(numbers: npt.NDArray[Any]) -> bool:
    return not numbers.size or float(np.abs(numbers).max()) <= MAX_MAGNITUDE

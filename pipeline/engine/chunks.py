"""The front of an artifact file: arrays as they lie in memory, summed in chunks, read where they are needed."""

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
from omninav.pipeline.graph.stored_rows import StoredRows

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
"""Rows that an array without any bytes may have: whoever goes through them row by row comes to an end."""


class Unfit(Exception):
    """What is wrong with an artifact's content, without its file's name."""


def parse_npy_head(head: io.BytesIO, length: int) -> tuple[tuple[int, ...], np.dtype[Any]]:
    """Shape and type that the head of a `.npy` states, for `length` bytes of head and array. Raises `Unfit`."""
    if np.lib.format.read_magic(head) != (1, 0):
        raise Unfit("an array is in another format than 1.0")
    shape, by_column, dtype = np.lib.format.read_array_header_1_0(head)
    left = length - head.tell()
    if dtype.hasobject or by_column or min(shape, default=0) < 0 or math.prod(shape) * dtype.itemsize != left:
        raise Unfit("an array is not as long as it says")
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
    """The front of an open artifact file. What lies in it is mapped, and each chunk is checked before its first use."""

    def __init__(self, path: Path, end: int, sums: npt.NDArray[np.uint8]) -> None:
        """`end`: where the front ends. Raises `Unfit` where the sums are not those of that many bytes."""
        if sums.dtype != np.uint8 or sums.shape != (-(-end // CHUNK), SUM):
            raise Unfit(f"its front of {end} bytes has sums of the shape {sums.shape!s:.40}")
        self.path, self._sums, self._end = path, sums, end
        self._file = os.open(path, os.O_RDONLY)  # chunks are read to be checked: what is mapped counts as memory
        weakref.finalize(self, os.close, self._file)
        self._mapped: npt.NDArray[np.uint8] = np.asarray(np.memmap(path, np.uint8, "r", shape=(end,)))

    def array(self, entry: zipfile.ZipInfo, whole: bool) -> npt.NDArray[Any] | StoredRows[Any]:
        """An array of the front; all of it in memory where it is to be `whole`, or is small.

        Raises `BadInput` where a chunk that is read is damaged, and `Unfit` where the file in the zip is no array.
        """
        name, size = entry.filename.removesuffix(".npy"), entry.file_size
        local = self._read(entry.header_offset, 30, name)
        begin = entry.header_offset + 30 + sum(int.from_bytes(local[at : at + 2], "little") for at in (26, 28))
        if entry.compress_type != zipfile.ZIP_STORED or len(local) < 30 or begin + size > self._end:
            raise Unfit(f"the array '{name:.40}' does not lie in its front")
        head = io.BytesIO(self._read(begin, min(size, _NPY_HEAD), name))
        shape, dtype = parse_npy_head(head, size)
        begin, size = begin + head.tell(), size - head.tell()
        if whole or size <= IN_MEMORY or not shape:
            content = self._read(begin, size, name)
            return np.frombuffer(content, dtype).reshape(shape) if size else np.empty(shape, dtype)
        if begin % dtype.itemsize:
            raise Unfit(f"the array '{name:.40}' is not aligned")
        array = np.frombuffer(self._mapped[begin : begin + size], dtype).reshape(shape)
        return StoredRows(array, self._row_check(name, begin, array))

    def _read(self, begin: int, size: int, name: str) -> bytearray:
        """Bytes of the front, checked; as many as there are."""
        begin = max(begin, 0)
        end = min(begin + size, self._end)
        found = bytearray()
        for chunk in range(begin // CHUNK, -(-end // CHUNK)):
            content, start = self._checked_chunk(chunk, name), chunk * CHUNK
            found += content[max(begin - start, 0) : end - start]
        return found

    def _row_check(self, name: str, begin: int, array: npt.NDArray[Any]) -> Callable[[npt.NDArray[np.int64]], None]:
        width = array.nbytes // len(array)
        sound = np.zeros(len(self._sums), bool)

        def check(rows: npt.NDArray[np.int64]) -> None:
            first, last = (begin + rows * width) // CHUNK, (begin + (rows + 1) * width - 1) // CHUNK
            more = int((last - first).max(initial=0)) + 1
            chunks = np.minimum(first[:, None] + np.arange(more), last[:, None]).ravel()
            for chunk in np.unique(chunks[~sound[chunks]]).tolist():
                content, start = self._checked_chunk(chunk, name), chunk * CHUNK
                own = content[max(begin - start, 0) : begin + array.nbytes - start]
                if array.dtype.kind == "f" and not _are_finite(np.frombuffer(own, array.dtype)):
                    raise BadInput(f"{self._place(chunk, name)} holds numbers that are not finite; make it again")
                sound[chunk] = True

        return check

    def _checked_chunk(self, chunk: int, name: str) -> bytes:
        start = chunk * CHUNK
        content = os.pread(self._file, min(CHUNK, self._end - start), start)
        if hashlib.sha256(content).digest() != self._sums[chunk].tobytes():
            raise BadInput(f"{self._place(chunk, name)} is damaged, its sha256 differs; make it again")
        return content

    def _place(self, chunk: int, name: str) -> str:
        return f"{self.path}: chunk {chunk} of the array '{name:.40}' (from byte {chunk * CHUNK})"


def _are_finite(numbers: npt.NDArray[Any]) -> bool:
    return not numbers.size or float(np.abs(numbers).max()) <= MAX_MAGNITUDE

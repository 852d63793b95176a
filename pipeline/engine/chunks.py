"""The front of an artifact file: arrays as they lie in memory, summed in chunks, read where they are needed."""

import hashlib
import io
import math
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
        self.path, self._sums = path, sums
        self._bytes: npt.NDArray[np.uint8] = np.asarray(np.memmap(path, np.uint8, "r", shape=(end,)))
        self._checked = np.zeros(len(sums), bool)

    def array(self, entry: zipfile.ZipInfo, whole: bool) -> npt.NDArray[Any] | StoredRows[Any]:
        """An array of the front; all of it in memory where it is to be `whole`, or is small.

        Raises `BadInput` where a chunk that is read is damaged, and `Unfit` where the file in the zip is no array.
        """
        name = entry.filename.removesuffix(".npy")
        end, size = len(self._bytes), entry.file_size
        at = entry.header_offset
        self._check(np.arange(max(at, 0) // CHUNK, -(-min(at + _NPY_HEAD, end) // CHUNK)), name)
        local = self._bytes[at : at + 30].tobytes() if at >= 0 else b""
        begin = at + 30 + int.from_bytes(local[26:28], "little") + int.from_bytes(local[28:30], "little")
        stored = entry.compress_type == zipfile.ZIP_STORED and entry.compress_size == size
        if len(local) < 30 or not stored or begin + size > end:
            raise Unfit(f"the array '{name:.40}' does not lie in its front")
        self._check(np.arange(begin // CHUNK, -(-min(begin + _NPY_HEAD, end) // CHUNK)), name)
        head = io.BytesIO(self._bytes[begin : begin + min(size, _NPY_HEAD)].tobytes())
        shape, dtype = parse_npy_head(head, size)
        begin += head.tell()
        flat = self._bytes[begin : begin + math.prod(shape) * dtype.itemsize]
        array = np.frombuffer(flat, dtype).reshape(shape) if flat.size else np.empty(shape, dtype)
        if whole or array.nbytes <= IN_MEMORY or not array.size:
            self._check(np.arange(begin // CHUNK, -(-(begin + array.nbytes) // CHUNK)), name)
            return np.array(array)
        return StoredRows(array, self._row_check(name, begin, array))

    def _row_check(self, name: str, begin: int, array: npt.NDArray[Any]) -> Callable[[npt.NDArray[np.int64]], None]:
        width, item, numbers = array.nbytes // len(array), array.dtype.itemsize, array.reshape(-1)
        sound = np.zeros(len(self._sums), bool)

        def check(rows: npt.NDArray[np.int64]) -> None:
            first, last = (begin + rows * width) // CHUNK, (begin + (rows + 1) * width - 1) // CHUNK
            more = int((last - first).max(initial=0)) + 1
            chunks = np.minimum(first[:, None] + np.arange(more), last[:, None]).ravel()
            chunks = chunks[~sound[chunks]]
            if not len(chunks):
                return
            self._check(chunks, name)
            for chunk in np.unique(chunks).tolist() if array.dtype.kind == "f" else ():
                start = max(chunk * CHUNK - begin, 0) // item
                part = numbers[start : max((chunk + 1) * CHUNK - begin, 0) // item]
                if part.size and not float(np.abs(part).max()) <= MAX_MAGNITUDE:
                    raise BadInput(f"{self._place(chunk, name)} holds numbers that are not finite; make it again")
            sound[chunks] = True

        return check

    def _check(self, chunks: npt.NDArray[np.int64], name: str) -> None:
        new = chunks[~self._checked[chunks]]
        for chunk in np.unique(new).tolist():
            content = self._bytes[chunk * CHUNK : (chunk + 1) * CHUNK]
            if hashlib.sha256(content.data).digest() != self._sums[chunk].tobytes():
                raise BadInput(f"{self._place(chunk, name)} is damaged, its sha256 differs; make it again")
            self._checked[chunk] = True

    def _place(self, chunk: int, name: str) -> str:
        return f"{self.path}: chunk {chunk} of the array '{name:.40}' (from byte {chunk * CHUNK})"

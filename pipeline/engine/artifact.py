"""Static results as files: versioned, checksummed, never unpickled."""

import hashlib
import importlib
import io
import json
import math
import zipfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
import numpy.typing as npt

from omninav.pipeline.files import user_path, whole_file
from omninav.pipeline.graph.contents import stored_fields, violation
from omninav.pipeline.graph.ports import convert
from omninav.pipeline.graph.problems import BadInput, shown
from omninav.pipeline.graph.stored_rows import StoredRows
from omninav.pipeline.graph.value import VALUE_TYPES, Value, value_name

from .chunks import Front, Unfit, parse_npy_head, sums_of, write_front, write_npy
from .codec import BadEncoding, decode, encode, field_names

FORMAT = 2
"""The newest; 1, which is the same without a front, is read and, of values without one, written too."""
OWN_PACKAGE = __name__.partition(".")[0]
_HEADER, _SUM = "header.json", "sha256:"
UNPACKED_BYTES, UNPACKED_RATIO = 1 << 26, 64
"""Largest unpacked size of a file: that many bytes, or that many times its own."""
_FRONT, _SUMS = "front:", "chunk_sums"
_SUM_BYTES, _FRONT_BYTES = len(_SUM) + 64, len(_FRONT) + 16
_NPY_HEAD, _STEP, _ROWS = 1 << 16, 1 << 20, 1 << 12


def write_artifact(path: Path, value: Value, facts: dict[str, Any] | None = None) -> None:
    """Write a value as one file: a zip of `.npy` arrays with a JSON header, its sha256 as comment.

    Arrays go to the file piece by piece, so that a large value needs no memory twice. `numpy.load` opens it. The header
    names the value's type, each field's array with its own sha256, and `facts` about how it was made. Top-level array
    fields are arrays of the file; everything else is encoded in one more. Arrays are deflated. Those of a value of
    which a field may be `StoredRows` are not: they are at the front of the file, summed in chunks (see `chunks`).
    """
    with whole_file(path) as part, part.open("w+b") as file:
        _write(file, value, facts)


def artifact_bytes(value: Value, facts: dict[str, Any] | None = None) -> bytes:
    """Bytes that `write_artifact` would write."""
    buffer = io.BytesIO()
    _write(buffer, value, facts)
    return buffer.getvalue()


def _write(file: BinaryIO, value: Value, facts: dict[str, Any] | None) -> None:
    fields = {name: getattr(value, name) for name in field_names(type(value))}
    arrays = {name: field for name, field in fields.items() if isinstance(field, np.ndarray | StoredRows)}
    rest = {name: field for name, field in fields.items() if name not in arrays}
    front = arrays if stored_fields(type(value)) else {}
    packed = {name: np.ascontiguousarray(array) for name, array in arrays.items() if name not in front}
    packed["rest"] = np.frombuffer(encode(rest), dtype=np.uint8)
    header: dict[str, Any] = {
        "format": FORMAT if front else FORMAT - 1,
        "type": value_name(type(value)),
        "facts": facts or {},
        "arrays": {name: hashlib.sha256(_bytes_of(array)).hexdigest() for name, array in packed.items()},
        **({"front": sorted(front)} if front else {}),
    }
    end = 0
    with zipfile.ZipFile(file, "w") as archive:
        if front:
            end = write_front(archive, front)
            packed[_SUMS] = sums_of(file, end)
            header["arrays"] |= {_SUMS: hashlib.sha256(_bytes_of(packed[_SUMS])).hexdigest()}
        archive.writestr(zipfile.ZipInfo(_HEADER), json.dumps(header, indent=1, sort_keys=True))
        for name, content in sorted(packed.items()):
            entry = zipfile.ZipInfo(f"{name}.npy")
            entry.compress_type = zipfile.ZIP_DEFLATED
            with archive.open(entry, "w") as member:
                write_npy(member, content)
        stated = f"{_FRONT}{end:0{_FRONT_BYTES - len(_FRONT)}}".encode() if front else b""
        archive.comment = stated + b" " * _SUM_BYTES
    size = file.seek(0, io.SEEK_END)
    file.write(_SUM.encode() + _sum(file, end, size - _SUM_BYTES).encode())


def _bytes_of(array: npt.NDArray[Any]) -> memoryview:
    """The bytes of a contiguous array, row by row, without a copy of them."""
    return array.reshape(-1).view(np.uint8).data


def read_header(path: Path) -> dict[str, Any]:
    """The header of an artifact file. Raises `BadInput` naming the file where it is missing, cut, changed or none."""
    with _opened(path) as (archive, _):
        return _header(archive)


def artifact_digest(path: Path) -> str:
    """The sha256 of an artifact file's content: its last 64 characters, checked.

    It is that of the whole file before it, or where the file has a front, of the sums of its chunks and what follows.
    """
    with path.open("rb") as file:
        _checked_sum(path, file)
        file.seek(-64, io.SEEK_END)
        return file.read().decode("ascii")


def type_and_facts(path: Path) -> tuple[type[Value], dict[str, Any]]:
    """The type of the value in an artifact file, and the facts about how it was made.

    Raises `BadInput` where this version knows no such type.
    """
    with _opened(path) as (archive, _):
        header = _header(archive)
        return _type(header), header["facts"]


def read_artifact(path: str | Path) -> Value:
    """The value in an artifact file, checked against what its fields state (see `graph.contents`).

    A large array in the front of the file is read, and checked, where it is needed (`StoredRows`).
    Raises `BadInput` naming the file where it is missing, cut or changed, and where its content is no such value.
    """
    path = user_path(path)
    with _opened(path) as (archive, end):
        header = _header(archive)
        cls = _type(header)
        fields: dict[str, Any] = {}
        for name, digest in header["arrays"].items():
            fields[name], found = _array(archive, f"{name}.npy")
            if found != digest:
                raise Unfit(f"the array '{name:.40}' is damaged (sha256 differs)")
        if end:
            front, stored = Front(path, end, fields.pop(_SUMS)), stored_fields(cls)
            for name in header.get("front", ()):
                fields[name] = front.array(archive.getinfo(f"{name}.npy"), name not in stored)
        try:
            value = cls(**fields | decode(fields.pop("rest").tobytes()))
        except (BadEncoding, TypeError) as error:
            raise Unfit(f"does not fit {cls.__name__} of this version ({error!s:.160})") from None
        wrong = violation(value)
        if wrong is not None:
            raise Unfit(f"it is not a valid {cls.__name__}: {wrong}")
        return value


def check_artifact(path: Path) -> None:
    """Read all of an artifact file once, and raise `BadInput` for whatever `read_artifact` would sooner or later."""
    value = read_artifact(path)
    for name in stored_fields(type(value)):
        rows = getattr(value, name)
        for start in range(0, len(rows), _ROWS) if isinstance(rows, StoredRows) else ():
            rows[start : start + _ROWS]


def _header(archive: zipfile.ZipFile) -> dict[str, Any]:
    header = json.loads(archive.read(_HEADER), parse_float=_finite, parse_constant=_finite)
    if not isinstance(header, dict) or header.get("format") not in (FORMAT - 1, FORMAT):
        found = header.get("format") if isinstance(header, dict) else None
        raise Unfit(f"written in format {found!r:.20}, this version reads up to {FORMAT}")
    for key, kind in (("type", str), ("arrays", dict), ("facts", dict)):
        if not isinstance(header.get(key), kind):
            raise Unfit(f"its header states no {key}")
    for key, (kind, expected) in _FACTS.items():
        if key in header["facts"] and convert(header["facts"][key], kind, key)[1]:
            raise Unfit(f"its header's {key} is {shown(header['facts'][key])}, expected {expected}")
    return header


@dataclass(frozen=True)
class Dropped:
    """Number of things of a kind that were dropped, and the first case."""

    count: int
    first: str = ""


_FACTS: dict[str, tuple[Any, str]] = {
    "dropped": (dict[str, int | Dropped], "counts by kind"),
    "facts": (dict, "facts by name"),
    "stages": (dict[str, dict[str, Any]], "parameters by stage"),
    "variant": (str | None, "a name"),
    "made_by": (str, "a name"),
    "warnings": (list[str], "texts"),
}
"""Facts that runs and reports read: their types, and what is expected in words."""


def _finite(text: str) -> float:
    """A number of a header. Raises `Unfit` where it is none that can be reckoned with."""
    if not math.isfinite(float(text)):
        raise Unfit(f"its header holds {text:.20}")
    return float(text)


def _type(header: Mapping[str, Any]) -> type[Value]:
    name = str(header["type"])
    if name not in VALUE_TYPES and name.startswith(f"{OWN_PACKAGE}."):
        parts = name.split(".")
        if all(part.isidentifier() and not part.startswith("_") for part in parts):
            with suppress(ImportError):
                importlib.import_module(".".join(parts[:-1]))
        if name not in VALUE_TYPES:
            raise Unfit(f"made with an older omninav (its '{name:.80}' is no longer known)")
    if name not in VALUE_TYPES:
        raise Unfit(f"holds a '{name:.80}', which is no value known here; load the stage that made it, or")
    return VALUE_TYPES[name]


def _array(archive: zipfile.ZipFile, name: str) -> tuple[npt.NDArray[Any], str]:
    """An array and the sha256 of its bytes. Its content is in memory once, and is as long as its header states."""
    content = memoryview(bytearray(archive.getinfo(name).file_size))
    with archive.open(name) as file:
        read = 0
        while number := file.readinto(content[read : read + _STEP]):  # type: ignore[attr-defined]
            read += number
    head = io.BytesIO(content[:_NPY_HEAD])
    shape, dtype = parse_npy_head(head, read)
    data, count = content[head.tell() : read], math.prod(shape)
    array = np.frombuffer(data, dtype, count).reshape(shape) if count else np.empty(shape, dtype)
    return array, hashlib.sha256(data).hexdigest()


@contextmanager
def _opened(path: Path) -> Iterator[tuple[zipfile.ZipFile, int]]:
    """The zip in an artifact file, and where its front ends (0: it has none), once the sum of what follows is checked.

    What is wrong inside becomes `BadInput` too.
    """
    if not path.is_file():
        inside = sorted(file.name for file in path.glob("*.omap")) if path.is_dir() else []
        named = f" in it: {', '.join(inside)}" if inside else ""
        what = f"this is a folder, expected a file{named}" if path.is_dir() else "there is no such file"
        raise BadInput(f"{path}: {what}")
    with path.open("rb") as file:
        end, size = _checked_sum(path, file)
        try:
            with zipfile.ZipFile(file) as archive:
                unpacked = sum(member.file_size for member in archive.infolist())
                if unpacked > max(UNPACKED_BYTES, UNPACKED_RATIO * size):
                    raise Unfit(f"it would unpack {size} bytes to {unpacked}")
                yield archive, end
        except Unfit as unfit:
            raise BadInput(f"{path}: {unfit}; make it again") from None
        except BadInput:
            raise
        except Exception as error:  # a right sum does not exclude that the content makes readers raise
            said = " ".join(str(error).split()).strip("'\"") or type(error).__name__
            raise BadInput(f"{path}: not a valid artifact ({said:.160}); make it again") from None


def _checked_sum(path: Path, file: BinaryIO) -> tuple[int, int]:
    """End of an artifact file's front, and the file's size. Raises `BadInput` where the sum of the rest is wrong."""
    size = file.seek(0, io.SEEK_END)
    file.seek(max(0, size - _SUM_BYTES - _FRONT_BYTES))
    front, stated = (ends := file.read())[:-_SUM_BYTES], ends[-_SUM_BYTES:]
    if not stated.startswith(_SUM.encode()):
        raise BadInput(f"{path}: not an artifact file, or cut off at its end; make it again")
    number = front.removeprefix(_FRONT.encode())
    end = int(number) if len(number) == _FRONT_BYTES - len(_FRONT) and number.isdigit() else 0
    if stated[len(_SUM) :].decode("ascii", "replace") != _sum(file, end, size - _SUM_BYTES):
        raise BadInput(f"{path}: damaged, its sha256 does not fit its content; make it again")
    return end, size


def _sum(file: BinaryIO, begin: int, end: int) -> str:
    """The sha256 of a part of a file, which is left at its end."""
    whole, left = hashlib.sha256(), end - begin
    file.seek(begin)
    while left > 0 and (piece := file.read(min(left, _STEP))):
        whole.update(piece)
        left -= len(piece)
    return whole.hexdigest()

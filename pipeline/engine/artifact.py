"""Static results as files: versioned, checksummed, never unpickled."""

import hashlib
import importlib
import io
import json
import math
import zipfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
import numpy.typing as npt

from omninav.pipeline.files import whole_file
from omninav.pipeline.graph.contents import misfit
from omninav.pipeline.graph.problems import BadInput
from omninav.pipeline.graph.value import VALUE_TYPES, Value, value_name

from .codec import BadEncoding, decode, encode, field_names

FORMAT = 1
OWN_PACKAGE = __name__.partition(".")[0]
_HEADER, _REST, _SUM = "header.json", "rest.npy", "sha256:"
UNPACKED_BYTES, UNPACKED_RATIO = 1 << 26, 64
"""How many bytes a file may unpack to: that many, or that many times its own."""
_NPY_HEAD, _STEP = 1 << 16, 1 << 20
_EMPTY_ROWS = 1 << 24
"""Rows that an array without any bytes may have: whoever goes through them row by row comes to an end."""


def write_artifact(path: Path, value: Value, facts: dict[str, Any] | None = None) -> None:
    """Write a value as one file: a deflated zip of `.npy` arrays with a JSON header, its sha256 as comment.

    Arrays go to the file piece by piece, so that a large value needs no memory twice. `numpy.load` opens it. The header
    names the value's type, each field's array with its own sha256, and `facts` about how it was made. Top-level array
    fields are arrays of the file; everything else is encoded in one more.
    """
    with whole_file(path) as part, part.open("w+b") as file:
        _write(file, value, facts)


def artifact_bytes(value: Value, facts: dict[str, Any] | None = None) -> bytes:
    """What `write_artifact` would write."""
    buffer = io.BytesIO()
    _write(buffer, value, facts)
    return buffer.getvalue()


def _write(file: BinaryIO, value: Value, facts: dict[str, Any] | None) -> None:
    fields = {name: getattr(value, name) for name in field_names(value)}
    arrays = {name: np.ascontiguousarray(field) for name, field in fields.items() if isinstance(field, np.ndarray)}
    rest = {name: field for name, field in fields.items() if name not in arrays}
    arrays["rest"] = np.frombuffer(encode(rest), dtype=np.uint8)
    header = {
        "format": FORMAT,
        "type": value_name(type(value)),
        "facts": facts or {},
        "arrays": {name: hashlib.sha256(_bytes_of(array)).hexdigest() for name, array in arrays.items()},
    }
    with zipfile.ZipFile(file, "w") as archive:
        archive.writestr(zipfile.ZipInfo(_HEADER), json.dumps(header, indent=1, sort_keys=True))
        for name, content in sorted(arrays.items()):
            entry = zipfile.ZipInfo(f"{name}.npy")
            entry.compress_type = zipfile.ZIP_DEFLATED
            with archive.open(entry, "w") as member:
                np.lib.format.write_array_header_1_0(member, np.lib.format.header_data_from_array_1_0(content))
                for start in range(0, content.nbytes, _STEP):
                    member.write(_bytes_of(content)[start : start + _STEP])
        archive.comment = b" " * (len(_SUM) + 64)
    left, whole = file.seek(0, io.SEEK_END) - len(archive.comment), hashlib.sha256()
    file.seek(0)
    while left > 0:
        whole.update(piece := file.read(min(left, _STEP)))
        left -= len(piece)
    file.write(_SUM.encode() + whole.hexdigest().encode())


def _bytes_of(array: npt.NDArray[Any]) -> memoryview:
    """The bytes of a contiguous array, row by row, without a copy of them."""
    return array.reshape(-1).view(np.uint8).data


def read_header(path: Path) -> dict[str, Any]:
    """The header of an artifact file. Raises `BadInput` naming the file where it is missing, cut, changed or none."""
    with _opened(path) as archive:
        return _header(archive)


def type_of(path: Path) -> type[Value]:
    """The type of the value in an artifact file. Raises `BadInput` where this version knows no such type."""
    with _opened(path) as archive:
        return _type(_header(archive))


def read_artifact(path: Path) -> Value:
    """The value in an artifact file, checked against what its fields state (see `graph.contents`).

    Raises `BadInput` naming the file where it is missing, cut or changed, and where its content is no such value.
    """
    with _opened(path) as archive:
        header = _header(archive)
        cls, fields = _type(header), {}
        for name, digest in header["arrays"].items():
            fields[name], found = _array(archive, f"{name}.npy")
            if found != digest:
                raise _Unfit(f"the array '{name:.40}' is damaged (sha256 differs)")
        try:
            value = cls(**fields | decode(fields.pop("rest").tobytes()))
        except (BadEncoding, TypeError) as error:
            raise _Unfit(f"does not fit {cls.__name__} of this version ({error!s:.160})") from None
        wrong = misfit(value)
        if wrong is not None:
            raise _Unfit(f"it is no sound {cls.__name__}: {wrong}")
        return value


class _Unfit(Exception):
    """What is wrong with an artifact's content, without its file's name."""


def _header(archive: zipfile.ZipFile) -> dict[str, Any]:
    header = json.loads(archive.read(_HEADER), parse_float=_finite, parse_constant=_finite)
    if not isinstance(header, dict) or header.get("format") != FORMAT:
        found = header.get("format") if isinstance(header, dict) else None
        raise _Unfit(f"written in format {found!r:.20}, this version reads {FORMAT}")
    for key, kind in (("type", str), ("arrays", dict), ("facts", dict)):
        if not isinstance(header.get(key), kind):
            raise _Unfit(f"its header says no {key}")
    return header


def _finite(text: str) -> float:
    """A number of a header. Raises `_Unfit` where it is none that can be reckoned with."""
    if not math.isfinite(float(text)):
        raise _Unfit(f"its header holds {text:.20}")
    return float(text)


def _type(header: Mapping[str, Any]) -> type[Value]:
    name = str(header["type"])
    if name not in VALUE_TYPES and name.startswith(f"{OWN_PACKAGE}."):
        parts = name.split(".")
        if all(part.isidentifier() and not part.startswith("_") for part in parts):
            with suppress(ImportError):
                importlib.import_module(".".join(parts[:-1]))
        if name not in VALUE_TYPES:
            raise _Unfit(f"made with an older omninav (its '{name:.80}' is no longer known)")
    if name not in VALUE_TYPES:
        raise _Unfit(f"holds a '{name:.80}', which is no value known here; load the stage that made it, or")
    return VALUE_TYPES[name]


def _array(archive: zipfile.ZipFile, name: str) -> tuple[npt.NDArray[Any], str]:
    """An array and the sha256 of its bytes. Its content is in memory once, and is as long as its header says."""
    content = memoryview(bytearray(archive.getinfo(name).file_size))
    with archive.open(name) as file:
        read = 0
        while number := file.readinto(content[read : read + _STEP]):  # type: ignore[attr-defined]
            read += number
    head = io.BytesIO(content[:_NPY_HEAD])
    if np.lib.format.read_magic(head) != (1, 0):
        raise _Unfit("an array is in another format than 1.0")
    shape, by_column, dtype = np.lib.format.read_array_header_1_0(head)
    data, count = content[head.tell() : read], math.prod(shape)
    if dtype.hasobject or by_column or min(shape, default=0) < 0 or count * dtype.itemsize != len(data):
        raise _Unfit("an array is not as long as it says")
    if not data.nbytes and max(shape, default=0) > _EMPTY_ROWS:
        raise _Unfit(f"an array of nothing has {max(shape)} rows")
    array = np.frombuffer(data, dtype, count).reshape(shape) if count else np.empty(shape, dtype)
    return array, hashlib.sha256(data).hexdigest()


@contextmanager
def _opened(path: Path) -> Iterator[zipfile.ZipFile]:
    """The zip in an artifact file, once its sum has been checked. What is wrong inside becomes `BadInput` too."""
    if not path.is_file():
        raise BadInput(f"{path}: there is no such file")
    content = path.read_bytes()
    size = len(_SUM) + 64
    whole, comment = memoryview(content)[:-size], content[-size:]
    if not comment.startswith(_SUM.encode()):
        raise BadInput(f"{path}: not an artifact file, or cut off at its end; make it again")
    if comment[len(_SUM) :].decode("ascii", "replace") != hashlib.sha256(whole).hexdigest():
        raise BadInput(f"{path}: damaged, its sha256 does not fit its content; make it again")
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            unpacked = sum(member.file_size for member in archive.infolist())
            if unpacked > max(UNPACKED_BYTES, UNPACKED_RATIO * len(content)):
                raise _Unfit(f"it would unpack {len(content)} bytes to {unpacked}")
            yield archive
    except _Unfit as unfit:
        raise BadInput(f"{path}: {unfit}; make it again") from None
    except (
        Exception
    ) as error:  # a sum that is right says nothing of the content: it raises whatever it makes readers raise
        said = " ".join(str(error).split()).strip("'\"") or type(error).__name__
        raise BadInput(f"{path}: no sound artifact ({said:.160}); make it again") from None

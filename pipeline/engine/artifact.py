"""Static results as files: versioned, checksummed, never unpickled."""

import hashlib
import importlib
import io
import json
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import numpy as np

from omninav.pipeline.files import write_whole
from omninav.pipeline.graph.problems import BadInput
from omninav.pipeline.graph.value import VALUE_TYPES, Value, value_name

from .codec import BadEncoding, decode, encode, field_names

FORMAT = 1
OWN_PACKAGE = __name__.partition(".")[0]
_HEADER, _REST, _SUM = "header.json", "rest.npy", "sha256:"


def write_artifact(path: Path, value: Value, facts: dict[str, Any] | None = None) -> None:
    """Write a value as one file, as `artifact_bytes` gives it."""
    write_whole(path, artifact_bytes(value, facts))


def artifact_bytes(value: Value, facts: dict[str, Any] | None = None) -> bytes:
    """A value as the content of a file: a deflated zip of `.npy` arrays with a JSON header, its sha256 as comment.

    `numpy.load` opens it. The header names the value's type, each field's array with its own sha256, and `facts`
    about how it was made. Top-level array fields are arrays of the file; everything else is encoded in one more.
    """
    fields = {name: getattr(value, name) for name in field_names(value)}
    arrays = {name: field for name, field in fields.items() if isinstance(field, np.ndarray)}
    rest = {name: field for name, field in fields.items() if name not in arrays}
    arrays["rest"] = np.frombuffer(encode(rest), dtype=np.uint8)
    header = {
        "format": FORMAT,
        "type": value_name(type(value)),
        "facts": facts or {},
        "arrays": {name: hashlib.sha256(np.ascontiguousarray(a).tobytes()).hexdigest() for name, a in arrays.items()},
    }
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        archive.writestr(zipfile.ZipInfo(_HEADER), json.dumps(header, indent=1, sort_keys=True))
        for name, content in sorted(arrays.items()):
            entry = zipfile.ZipInfo(f"{name}.npy")
            entry.compress_type = zipfile.ZIP_DEFLATED
            with archive.open(entry, "w") as file:
                np.lib.format.write_array(file, np.ascontiguousarray(content), allow_pickle=False)
        archive.comment = b" " * (len(_SUM) + 64)
    whole = buffer.getvalue()[: -len(archive.comment)]
    return whole + _SUM.encode() + hashlib.sha256(whole).hexdigest().encode()


def read_header(path: Path) -> dict[str, Any]:
    """The header of an artifact file. Raises `BadInput` naming the file where it is missing, cut or changed."""
    with _opened(path) as archive:
        header: dict[str, Any] = json.loads(archive.read(_HEADER))
    if header.get("format") != FORMAT:
        raise BadInput(f"{path}: written in format {header.get('format')}, this version reads {FORMAT}; make it again")
    return header


def type_of(path: Path) -> type[Value]:
    """The type of the value in an artifact file. Raises `BadInput` where this version knows no such type."""
    name = str(read_header(path)["type"])
    if name not in VALUE_TYPES and name.startswith(f"{OWN_PACKAGE}."):
        with suppress(ImportError):
            importlib.import_module(name.rpartition(".")[0])
        if name not in VALUE_TYPES:
            raise BadInput(f"{path}: made with an older omninav (its '{name}' is no longer known); make it again")
    if name not in VALUE_TYPES:
        raise BadInput(f"{path}: holds a '{name}', which is no value known here; load the stage that made it")
    return VALUE_TYPES[name]


def read_artifact(path: Path) -> Value:
    """The value in an artifact file. Raises `BadInput` naming the file where it is missing, cut or changed."""
    header, cls = read_header(path), type_of(path)
    fields: dict[str, Any] = {}
    with _opened(path) as archive:
        for name, digest in header["arrays"].items():
            content = np.lib.format.read_array(io.BytesIO(archive.read(f"{name}.npy")), allow_pickle=False)
            if hashlib.sha256(content.tobytes()).hexdigest() != digest:
                raise BadInput(f"{path}: the array '{name}' is damaged (sha256 differs); make it again")
            fields[name] = content
    try:
        fields |= decode(fields.pop("rest").tobytes())
        return cls(**fields)
    except (BadEncoding, TypeError) as error:
        raise BadInput(f"{path}: does not fit {cls.__name__} of this version ({error}); make it again") from None


@contextmanager
def _opened(path: Path) -> Iterator[zipfile.ZipFile]:
    if not path.is_file():
        raise BadInput(f"{path}: there is no such file")
    content = path.read_bytes()
    size = len(_SUM) + 64
    whole, comment = content[:-size], content[-size:]
    if not comment.startswith(_SUM.encode()):
        raise BadInput(f"{path}: not an artifact file, or cut off at its end; make it again")
    if comment[len(_SUM) :].decode("ascii", "replace") != hashlib.sha256(whole).hexdigest():
        raise BadInput(f"{path}: damaged, its sha256 does not fit its content; make it again")
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        yield archive

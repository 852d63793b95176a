"""Values, states and generators as bytes and back: plain JSON beside raw array bytes. Nothing is ever unpickled."""

import dataclasses
import hashlib
import json
import struct
from collections import Counter
from collections.abc import Callable
from enum import Enum
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from omninav.pipeline.graph.stage import State
from omninav.pipeline.graph.stored_rows import StoredRows
from omninav.pipeline.graph.value import VALUE_TYPES, Value, value_name

_LENGTH = struct.Struct("<Q")
_PLAIN = (str, bool, int, float, type(None))
_to_json = json.JSONEncoder(separators=(",", ":")).encode


class BadEncoding(ValueError):
    """Bytes that are not what `encode` wrote, or a thing that cannot be written. The message is one line."""


def encode(thing: Any) -> bytes:
    """A value (or plain data, lists, dicts, arrays) as bytes: a JSON header, then the arrays one after the other."""
    arrays: list[bytes] = []
    header = _to_json(_describe(thing, arrays)).encode()
    return b"".join([_LENGTH.pack(len(header)), header, *arrays])


def decode(content: bytes | memoryview) -> Any:
    """Decodes what `encode` wrote. Raises `BadEncoding` where the bytes are damaged or name no value."""
    view = memoryview(content)
    try:
        (size,) = _LENGTH.unpack_from(view)
        start = _LENGTH.size + size
        header = json.loads(bytes(view[_LENGTH.size : start]))
        return _restore(header, view[start:])
    except BadEncoding:
        raise
    except Exception as error:
        raise BadEncoding(f"damaged or foreign bytes ({type(error).__name__}: {error})") from None


def _describe(thing: Any, arrays: list[bytes]) -> Any:
    # plain JSON where JSON is exact; everything else is a list whose first item names its form
    if type(thing) in _PLAIN:
        return thing
    if isinstance(thing, Value):
        kind = type(thing)
        described = ["value", _name_of(kind)]
        for name in field_names(kind):
            field = getattr(thing, name)
            described.append(field if type(field) in _PLAIN else _describe(field, arrays))
        return described
    if isinstance(thing, Enum):
        raise BadEncoding(f"{thing!r} is an Enum: use a Literal instead")
    if isinstance(thing, _PLAIN):
        return thing
    if isinstance(thing, np.ndarray | StoredRows):
        if thing.dtype.hasobject:
            raise BadEncoding("an array of objects cannot be written: use a numeric array")
        arrays.append(np.ascontiguousarray(thing).tobytes())
        offset = sum(map(len, arrays[:-1]))
        return ["array", thing.dtype.str, list(thing.shape), offset]
    if isinstance(thing, np.generic):
        return ["scalar", thing.dtype.str, thing.tobytes().hex()]
    if isinstance(thing, bytes):
        arrays.append(thing)
        return ["bytes", len(thing), sum(map(len, arrays[:-1]))]
    if isinstance(thing, tuple):
        return ["tuple", *[_describe(item, arrays) for item in thing]]
    if isinstance(thing, list):
        return ["list", *[_describe(item, arrays) for item in thing]]
    if isinstance(thing, Counter):
        return ["counter", [[key, number] for key, number in thing.items()]]
    if isinstance(thing, dict):
        return ["dict", [[_describe(key, arrays), _describe(item, arrays)] for key, item in thing.items()]]
    if isinstance(thing, Path):
        return ["path", str(thing)]
    raise BadEncoding(f"{type(thing).__module__}.{type(thing).__qualname__} cannot be written: make it a Value")


def _restore(header: Any, data: memoryview) -> Any:
    if not isinstance(header, list):
        return header
    form, *rest = header
    if form == "array":
        dtype, shape, offset = np.dtype(rest[0]), tuple(rest[1]), rest[2]
        count = int(np.prod(shape, dtype=np.int64))
        if offset + count * dtype.itemsize > len(data):
            raise BadEncoding("cut short inside an array")
        return np.frombuffer(data, dtype=dtype, count=count, offset=offset).reshape(shape).copy()
    if form == "scalar":
        return np.frombuffer(bytes.fromhex(rest[1]), dtype=np.dtype(rest[0]))[0]
    if form == "bytes":
        return bytes(data[rest[1] : rest[1] + rest[0]])
    if form == "value":
        cls = VALUE_TYPES.get(rest[0])
        if cls is None:
            raise BadEncoding(f"unknown value type '{rest[0]}': is the module that defines it loaded?")
        names = field_names(cls)
        if len(names) != len(rest) - 1:
            raise BadEncoding(f"'{rest[0]}' has {len(names)} fields now, {len(rest) - 1} in the file")
        return cls(**{name: _restore(item, data) for name, item in zip(names, rest[1:], strict=True)})
    if form == "tuple":
        return tuple(_restore(item, data) for item in rest)
    if form == "list":
        return [_restore(item, data) for item in rest]
    if form == "counter":
        return Counter({key: number for key, number in rest[0]})
    if form == "dict":
        return {_restore(key, data): _restore(item, data) for key, item in rest[0]}
    if form == "path":
        return Path(rest[0])
    raise BadEncoding(f"unknown form '{form}'")


def _field_names(cls: Any) -> tuple[str, ...]:
    return tuple(field.name for field in dataclasses.fields(cls))


field_names: Callable[[Any], tuple[str, ...]] = cache(_field_names)
"""The fields of a class of values or states, which their base classes make dataclasses of."""
_name_of: Callable[[Any], str] = cache(value_name)


def encode_state(state: State) -> dict[str, Any]:
    """A state's fields as plain data for `encode`. Dataclasses inside a state must be Values."""
    return {name: getattr(state, name) for name in field_names(type(state))}


def restore_state(state: State, fields: dict[str, Any]) -> None:
    """Put decoded fields back into a fresh state. Raises `BadEncoding` where the names have changed."""
    names = set(field_names(type(state)))
    if names != set(fields):
        raise BadEncoding(f"{type(state).__qualname__} has fields {sorted(names)}, the file has {sorted(fields)}")
    for name, value in fields.items():
        setattr(state, name, value)


def seal(content: bytes) -> bytes:
    """Content with its sha256 before it."""
    return hashlib.sha256(content).digest() + content


def unseal(sealed: bytes, what: str) -> bytes:
    """Sealed content without its sum. Raises `BadEncoding` naming `what` where it was cut or changed."""
    content = sealed[32:]
    if len(sealed) < 32 or hashlib.sha256(content).digest() != sealed[:32]:
        raise BadEncoding(f"{what} is damaged: its sha256 does not fit its content")
    return content

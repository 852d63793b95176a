"""Values, states and generators as bytes and back: plain JSON beside raw array bytes. Nothing is ever unpickled."""

import dataclasses
import hashlib
import json
import re
import struct
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import MISSING
from enum import Enum
from functools import cache
from itertools import takewhile
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from omninav.pipeline.graph.registry import OF_A_FILE
from omninav.pipeline.graph.stage import State
from omninav.pipeline.graph.stored_rows import StoredRows
from omninav.pipeline.graph.value import VALUE_TYPES, Value, value_name

_LENGTH = struct.Struct("<Q")
FOLDER = re.compile(rf"(?<=^{OF_A_FILE})(.*)_[0-9a-f]{{8}}(?=\.)")
"""Finds, in the name of a class of a file, the file's name and a digest of its folder."""
_PLAIN = (str, bool, int, float, type(None))
_PLAIN_TYPES = frozenset(_PLAIN)
_to_json = json.JSONEncoder(separators=(",", ":")).encode


class BadEncoding(ValueError):
    """Bytes that are not what `encode` wrote, or a thing that cannot be written. The message is one line."""


class _Arrays:
    """The bytes of arrays, which follow the header one after the other."""

    def __init__(self) -> None:
        self.parts: list[bytes] = []
        self.size = 0

    def add(self, content: bytes) -> int:
        """Appends an array's bytes. Returns their offset."""
        offset = self.size
        self.parts.append(content)
        self.size += len(content)
        return offset


def encode(thing: Any) -> bytes:
    """A value (or plain data, lists, dicts, arrays) as bytes: a JSON header, then the arrays one after the other."""
    return _encoded(thing, _describe)


def encode_all(things: Sequence[Any]) -> bytes:
    """Encodes several things; values of one class field by field, so that the header names class and fields once."""
    return _encoded(things, _describe_all)


def decode(content: bytes | memoryview) -> Any:
    """Decodes what `encode` wrote. Raises `BadEncoding` where the bytes are damaged or name no value."""
    return _decoded(content, _restore)


def decode_all(content: bytes | memoryview, number: int) -> list[Any]:
    """Decodes this many things that `encode_all` wrote. Raises `BadEncoding` as `decode` does."""
    found: list[Any] = _decoded(content, lambda header, data: _restore_all(header, data, number))
    return found


def _encoded(thing: Any, describe: Callable[[Any, _Arrays], Any]) -> bytes:
    arrays = _Arrays()
    header = _to_json(describe(thing, arrays)).encode()
    return b"".join([_LENGTH.pack(len(header)), header, *arrays.parts])


def _decoded(content: bytes | memoryview, restore: Callable[[Any, memoryview], Any]) -> Any:
    view = memoryview(content)
    try:
        (size,) = _LENGTH.unpack_from(view)
        start = _LENGTH.size + size
        header = json.loads(bytes(view[_LENGTH.size : start]))
        return restore(header, view[start:])
    except BadEncoding:
        raise
    except Exception as error:
        raise BadEncoding(f"damaged or foreign bytes ({type(error).__name__}: {error})") from None


def _describe_all(things: Sequence[Any], arrays: _Arrays) -> Any:
    # what all have in common is stated once; things that differ are described one by one
    kinds = set(map(type, things))
    if kinds <= _PLAIN_TYPES:
        return ["plain", *things]
    kind = kinds.pop()
    if not kinds and issubclass(kind, Value):
        columns = [[getattr(thing, name) for thing in things] for name in field_names(kind)]
        return ["values", _name_of(kind), *(_describe_all(column, arrays) for column in columns)]
    if not kinds and kind is dict and all(list(thing) == list(things[0]) for thing in things):
        keys = list(things[0])
        columns = [[thing[key] for thing in things] for key in keys]
        return ["dicts", _describe(keys, arrays), *(_describe_all(column, arrays) for column in columns)]
    forms = {(thing.dtype, thing.shape) for thing in things} if not kinds and kind is np.ndarray else ()
    if len(forms) == 1 and _of_numbers(things[0].dtype):
        offset = arrays.add(b"".join([thing.tobytes() for thing in things]))
        return ["arrays", things[0].dtype.str, list(things[0].shape), offset]
    return ["each", *(_describe(thing, arrays) for thing in things)]


def _of_numbers(dtype: np.dtype[Any]) -> bool:
    """Tells whether arrays of this type are plain: neither objects nor records with names."""
    return not (dtype.hasobject or dtype.names)


def _restore_all(header: Any, data: memoryview, number: int) -> list[Any]:
    form, *rest = header
    if form == "arrays":
        stacked = _array(rest[0], [number, *rest[1]], rest[2], data)
        return [stacked[n, ...].copy() for n in range(number)]
    if form in ("values", "dicts"):
        columns = [_restore_all(column, data, number) for column in rest[1:]]
        rows = zip(*columns, strict=True) if columns else [()] * number
        if form == "dicts":
            keys = _restore(rest[0], data)
            return [dict(zip(keys, row, strict=True)) for row in rows]
        cls, names = _value_class(rest[0], len(columns))
        return [cls(**dict(zip(names, row, strict=True))) for row in rows]
    if form not in ("plain", "each") or len(rest) != number:
        raise BadEncoding(f"not {number} things")
    return rest if form == "plain" else [_restore(item, data) for item in rest]


def _describe(thing: Any, arrays: _Arrays) -> Any:
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
        if not _of_numbers(thing.dtype) or isinstance(thing, np.ma.MaskedArray):
            such = "with a mask" if isinstance(thing, np.ma.MaskedArray) else f"of {thing.dtype}"
            raise BadEncoding(f"an array {such} cannot be written: use a plain array of numbers")
        return ["array", thing.dtype.str, list(thing.shape), arrays.add(np.ascontiguousarray(thing).tobytes())]
    if isinstance(thing, np.generic):
        return ["scalar", thing.dtype.str, thing.tobytes().hex()]
    if isinstance(thing, bytes):
        return ["bytes", len(thing), arrays.add(thing)]
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
        return _array(rest[0], rest[1], rest[2], data).copy()
    if form == "scalar":
        return np.frombuffer(bytes.fromhex(rest[1]), dtype=np.dtype(rest[0]))[0]
    if form == "bytes":
        return bytes(data[rest[1] : rest[1] + rest[0]])
    if form == "value":
        cls, names = _value_class(rest[0], len(rest) - 1)
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


def _array(dtype_name: str, shape: list[int], offset: int, data: memoryview) -> npt.NDArray[Any]:
    dtype = np.dtype(dtype_name)
    count = int(np.prod(shape, dtype=np.int64))
    if offset + count * dtype.itemsize > len(data):
        raise BadEncoding("cut short inside an array")
    return np.frombuffer(data, dtype=dtype, count=count, offset=offset).reshape(shape)


def _value_class(name: str, fields: int) -> tuple[type[Value], tuple[str, ...]]:
    name, _, listed = name.partition("(")
    cls = VALUE_TYPES.get(name) or _of_moved_file(name)
    if cls is None:
        raise BadEncoding(f"unknown value type '{name}': is the module that defines it loaded?")
    names = field_names(cls)
    if listed:
        there = tuple(listed.rstrip(")").split(","))
        if not {*names[: len(names) - _defaults(cls)]} <= {*there} <= {*names}:
            raise BadEncoding(f"'{name}' has the fields {', '.join(names)} now, {', '.join(there)} in the file")
        return cls, there
    if not len(names) - _defaults(cls) <= fields <= len(names):
        raise BadEncoding(f"'{name}' has {len(names)} fields now, {fields} in the file")
    return cls, names[:fields]  # a field that an older file does not have takes its default


def _of_moved_file(name: str) -> type[Value] | None:
    """The class of a file that lay elsewhere, by the file's name; None where there is none, or several."""
    own = FOLDER.sub(r"\1", name)
    found = [cls for known, cls in VALUE_TYPES.items() if FOLDER.sub(r"\1", known) == own != name]
    return found[0] if len(found) == 1 else None


def _field_names(cls: Any) -> tuple[str, ...]:
    return tuple(field.name for field in dataclasses.fields(cls))


def _defaults(cls: Any) -> int:
    """Counts the last fields of a class that have a default."""
    known = [field.default is not MISSING or field.default_factory is not MISSING for field in dataclasses.fields(cls)]
    return len(list(takewhile(bool, reversed(known))))


field_names: Callable[[Any], tuple[str, ...]] = cache(_field_names)
"""The fields of a class of values or states, which their base classes make dataclasses of."""


def _named(cls: Any) -> str:
    """The name of a value's class; of another's than ours with its fields, whose order may change."""
    name = value_name(cls)
    fields = field_names(cls)
    return name if name.startswith("omninav.") or not fields else f"{name}({','.join(fields)})"


_name_of: Callable[[Any], str] = cache(_named)


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

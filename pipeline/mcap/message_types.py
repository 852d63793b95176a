"""ROS 2 message types: those that come with ROS, those that a file defines, and messages made from mappings."""

import struct
from collections.abc import Callable, Collection, Mapping
from functools import cache, lru_cache, partial
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from omninav.pipeline.graph.problems import nearest

from .message import LogError

if TYPE_CHECKING:
    from rosbags.typesys.store import Typestore

_STAMP_LITTLE, _STAMP_BIG = struct.Struct("<iI").unpack_from, struct.Struct(">iI").unpack_from
_BYTES = {"octet": "uint8", "byte": "uint8", "char": "uint8"}
_DEFINITION_ENCODINGS = ("ros2msg", "ros2idl")
MAX_DEFINITION = 100_000
"""Bytes of a message's definition with all that it is made of; those of ROS have some 5000."""


MAX_PARTS = 100_000
"""Largest number of messages and texts in a message's arrays of fixed length, each within each other."""


@cache
def standard_types() -> "Typestore":
    """The message types that come with ROS 2."""
    from rosbags.typesys import Stores, get_typestore

    return get_typestore(Stores.ROS2_HUMBLE)


@lru_cache(maxsize=64)
def types_of(msgtype: str, encoding: str, definition: bytes) -> "Typestore":
    """The message types in a definition; the standard ones where it is not whole or not readable."""
    from rosbags.typesys import Stores, get_types_from_idl, get_types_from_msg, get_typestore

    if encoding not in _DEFINITION_ENCODINGS or len(definition) > MAX_DEFINITION:
        return standard_types()
    store = get_typestore(Stores.EMPTY)
    try:
        text = definition.decode()
        store.register(get_types_from_msg(text, msgtype) if encoding == "ros2msg" else get_types_from_idl(text))
        refuse_long_arrays(store, msgtype)
        store.get_msgdef(msgtype)  # fails where a part of the definition is missing
    except Exception:
        return standard_types()
    return store


def refuse_long_arrays(store: "Typestore", msgtype: str) -> None:
    """Raise ValueError for a type of too many parts, however few bytes they take: its code alone might take minutes."""
    from rosbags.interfaces import Nodetype

    @cache
    def parts(name: str) -> int:
        return 1 + sum(of_field(*definition) for _, definition in store.fielddefs[name][1])

    def of_field(kind: Any, detail: Any) -> int:
        if kind == Nodetype.NAME:
            return parts(detail)
        if kind == Nodetype.BASE:
            return 1
        inner, length = detail
        numbers = inner[0] == Nodetype.BASE and inner[1][0] not in ("string", "wstring")
        return 1 if numbers else of_field(*inner) * (length if kind == Nodetype.ARRAY else 1)

    if parts(msgtype) > MAX_PARTS:
        raise ValueError(f"{msgtype} has more than {MAX_PARTS:,} parts")


def has_header(store: "Typestore", msgtype: str) -> bool:
    """Tell whether messages of a type begin with a header."""
    fields = store.fielddefs.get(msgtype, ([], []))[1]
    return bool(fields) and fields[0][1][1] == "std_msgs/msg/Header"


def header_stamp(data: bytes | memoryview, cdr: bool = True) -> int | None:
    """The stamp (ns) of a message that begins with a header; None where it is too short for one.

    CDR has 4 bytes of encapsulation before it, ROS 1 (`cdr` false) as many of a sequence number.
    """
    if len(data) < 12:
        return None
    seconds, nanoseconds = _STAMP_BIG(data, 4) if cdr and not data[1] & 1 else _STAMP_LITTLE(data, 4)
    return int(seconds) * 1_000_000_000 + int(nanoseconds)


def encode_message(msgtype: str, content: Any, stamp: int | None = None) -> bytes:
    """CDR bytes of a message: a rosbags message object, or a mapping as `make_message` takes it.

    Raises `LogError` for an unknown type or field, and for what does not fit its field.
    """
    if isinstance(content, Mapping):
        content = make_message(msgtype, content, stamp)
    try:
        return bytes(standard_types().serialize_cdr(content, msgtype))
    except Exception as error:
        raise LogError(f"not a valid {msgtype} ({error})") from None


def make_message(msgtype: str, fields: Mapping[str, Any], stamp: int | None = None) -> Any:
    """A rosbags message from nested mappings; fields left out are zero or empty, `stamp` (ns) fills the header.

    Raises `LogError` for an unknown type or field, with the nearest name.
    """
    message = _maker(msgtype)(fields)
    if stamp is not None and hasattr(message, "header"):
        message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp, 1_000_000_000)
    return message


@cache
def _maker(msgtype: str) -> Callable[[Mapping[str, Any]], Any]:
    """Makes messages of a type: its definition is gone through once, and not for every message."""
    store = standard_types()
    if msgtype not in store.fielddefs:
        raise LogError(f"{msgtype}: no such message type{_nearest(msgtype, store.fielddefs)}")
    makers = {name: _field_maker(definition) for name, definition in store.fielddefs[msgtype][1]}
    of_type = store.types[msgtype]

    def make(fields: Mapping[str, Any]) -> Any:
        for name in fields:
            if name not in makers:
                raise LogError(f"{msgtype}: no field '{name}'{_nearest(name, makers)}")
        return of_type(**{name: maker(fields.get(name)) for name, maker in makers.items()})

    return make


def _field_maker(definition: Any) -> Callable[[Any], Any]:
    from rosbags.interfaces import Nodetype

    kind, detail = definition
    if kind == Nodetype.NAME:
        make = _maker(detail)
        return lambda value: make(value or {}) if value is None or isinstance(value, Mapping) else value
    if kind == Nodetype.BASE:
        empty: Any = "" if detail[0] in ("string", "wstring") else False if detail[0] == "bool" else 0
        return lambda value: empty if value is None else value
    inner, count = detail
    length = count if kind == Nodetype.ARRAY else 0
    if inner[0] == Nodetype.BASE and inner[1][0] not in ("string", "wstring"):
        return partial(_numbers, np.dtype(_BYTES.get(inner[1][0], inner[1][0])), length)
    return partial(_items, _field_maker(inner), inner[0] == Nodetype.NAME, length)


def _numbers(dtype: np.dtype[Any], length: int, value: Any) -> npt.NDArray[Any]:
    if value is None:
        return np.zeros(length, dtype)
    return np.frombuffer(value, dtype) if isinstance(value, (bytes, memoryview)) else np.asarray(value, dtype)


def _items(make: Callable[[Any], Any], messages: bool, length: int, value: Any) -> Any:
    if value and messages and not isinstance(value[0], Mapping):  # message objects already
        return value
    return [make(item) for item in (value if value is not None else [None] * length)]


def _nearest(name: str, names: Collection[str]) -> str:
    near = nearest(name, names)
    return f"; did you mean '{near}'?" if near else ""

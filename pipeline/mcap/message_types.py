"""ROS 2 message types: those that come with ROS, those that a file defines, and messages made from mappings."""

from collections.abc import Collection, Mapping
from functools import cache, lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np

from omninav.pipeline.graph.problems import nearest

from .message import LogError

if TYPE_CHECKING:
    from rosbags.typesys.store import Typestore

_DEFINITION_ENCODINGS = ("ros2msg", "ros2idl")
MAX_DEFINITION = 100_000
"""Bytes of a message's definition with all that it is made of; those of ROS have some 5000."""


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
        store.get_msgdef(msgtype)  # fails where a part of the definition is missing
    except Exception:
        return standard_types()
    return store


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
    store = standard_types()
    if msgtype not in store.fielddefs:
        raise LogError(f"{msgtype}: no such message type{_nearest(msgtype, store.fielddefs)}")
    definitions = dict(store.fielddefs[msgtype][1])
    for name in fields:
        if name not in definitions:
            raise LogError(f"{msgtype}: no field '{name}'{_nearest(name, definitions)}")
    kinds = _kinds()
    values = {name: _make_field(definition, fields.get(name), kinds) for name, definition in definitions.items()}
    if stamp is not None and "header" in definitions:
        seconds, nanoseconds = divmod(stamp, 1_000_000_000)
        values["header"].stamp.sec, values["header"].stamp.nanosec = (
            seconds,
            nanoseconds,
        )
    return store.types[msgtype](**values)


@cache
def _kinds() -> Any:
    from rosbags.interfaces import Nodetype

    return Nodetype


def _make_field(definition: Any, value: Any, kinds: Any) -> Any:
    kind, detail = definition
    if kind == kinds.NAME:
        return make_message(detail, value or {}) if value is None or isinstance(value, Mapping) else value
    if kind == kinds.BASE:
        name = detail[0]
        empty: Any = "" if name in ("string", "wstring") else False if name == "bool" else 0
        return empty if value is None else value
    inner, count = detail
    if inner[0] == kinds.BASE and inner[1][0] not in ("string", "wstring"):
        dtype = np.dtype({"octet": "uint8", "byte": "uint8", "char": "uint8"}.get(inner[1][0], inner[1][0]))
        if value is None:
            return np.zeros(count if kind == kinds.ARRAY else 0, dtype)
        return np.frombuffer(value, dtype) if isinstance(value, (bytes, memoryview)) else np.asarray(value, dtype)
    if value and inner[0] == kinds.NAME and not isinstance(value[0], Mapping):  # message objects already
        return value
    length = count if kind == kinds.ARRAY else 0
    return [_make_field(inner, item, kinds) for item in (value if value is not None else [None] * length)]


def _nearest(name: str, names: Collection[str]) -> str:
    near = nearest(name, names)
    return f"; did you mean '{near}'?" if near else ""

"""Many messages of one shape as the rows of an array that holds their CDR bytes."""

from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from .message_types import encode_message, make_message, standard_types

if TYPE_CHECKING:
    from rosbags.typesys.store import Typestore

_HEAD = 4
"""Bytes before a message's body, which its alignment does not count."""


class MessageRows:
    """Encodes many messages of one type that differ in their numbers alone, hundreds of times as fast as one by one.

    `example` is a message of the type as `make_message` takes it: it has the texts, and as many items in each
    sequence as all of them. Raises `LogError` for an unknown type or field, and `ValueError` where the items of a
    sequence, but for the first, differ in their texts.
    """

    def __init__(self, msgtype: str, example: Any) -> None:
        message = make_message(msgtype, example)
        self._bytes = np.frombuffer(encode_message(msgtype, message), np.uint8)
        body, begin, end = _struct(standard_types(), msgtype, message, 0)
        if end + _HEAD != len(self._bytes):
            raise ValueError(f"{msgtype}: items of a sequence differ in their texts")
        self._dtype = np.dtype(
            {"names": ["body"], "formats": [body], "offsets": [_HEAD + begin], "itemsize": len(self._bytes)}
        )

    def rows(self, number: int) -> npt.NDArray[np.void]:
        """So many copies of the example, whose numbers can be assigned by field: `rows["header"]["stamp"]["sec"]`.

        The items of a sequence are an axis of the array; where the first of them is laid out otherwise than the others
        (as alignment has it), they are the fields `first` and `rest`.
        """
        rows: npt.NDArray[np.void] = np.tile(self._bytes, number).view(self._dtype)["body"]
        return rows


def row_bytes(rows: npt.NDArray[np.void]) -> list[bytes]:
    """The CDR bytes of each of `MessageRows.rows`."""
    content: bytes = rows.base.tobytes()  # type: ignore[union-attr]
    width = len(content) // max(len(rows), 1)
    return [content[at : at + width] for at in range(0, len(content), max(width, 1))]


def _struct(store: "Typestore", msgtype: str, message: Any, at: int) -> tuple[np.dtype[Any], int, int]:
    """Computes the layout of a message that is written after `at` bytes, with its first and its last byte."""
    names, formats, starts, begin = [], [], [], -1
    for name, definition in store.fielddefs[msgtype][1]:
        dtype, start, at = _field(store, definition, getattr(message, name), at)
        begin = start if begin < 0 else begin
        if dtype is not None:
            names.append(name)
            formats.append(dtype)
            starts.append(start)
    begin = max(begin, 0)
    offsets = [start - begin for start in starts]
    return np.dtype({"names": names, "formats": formats, "offsets": offsets, "itemsize": at - begin}), begin, at


def _field(store: "Typestore", definition: Any, value: Any, at: int) -> tuple[np.dtype[Any] | None, int, int]:
    """Type (None: nothing to assign), begin and end of a field that is written after `at` bytes."""
    from rosbags.interfaces import Nodetype

    kind, detail = definition
    if kind == Nodetype.NAME:
        return _struct(store, detail, value, at)
    if kind == Nodetype.BASE:
        if detail[0] in ("string", "wstring"):
            start = _aligned(at, 4)
            return None, start, start + 4 + len(value.encode()) + 1
        number = np.dtype(detail[0])
        start = _aligned(at, number.itemsize)
        return number, start, start + number.itemsize
    counted = at if kind == Nodetype.ARRAY else _aligned(at, 4) + 4
    if not len(value):
        return None, counted, counted
    if isinstance(value, np.ndarray):
        start = _aligned(counted, value.dtype.itemsize)
        return np.dtype((value.dtype, value.shape)), start, start + value.nbytes
    first, start, end = _field(store, detail[0], value[0], counted)
    if first is None or len(value) == 1:
        return None if first is None else np.dtype((first, (1,))), start, end
    other, again, after = _field(store, detail[0], value[1], end)
    rest = len(value) - 1
    if first == other and again == end:
        return np.dtype((first, (len(value),))), start, start + len(value) * first.itemsize
    offsets, formats = [0, again - start], [first, (other, (rest,))]
    each = np.dtype({"names": ["first", "rest"], "formats": formats, "offsets": offsets})
    return each, start, again + rest * (after - again)


def _aligned(at: int, size: int) -> int:
    return at + -at % size

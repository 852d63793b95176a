"""Small text and YAML files, read within limits: whatever their bytes are, plain data or one line on what is wrong."""

import copy
import math
import stat
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import yaml

from .problems import BadInput, shown

MAX_BYTES = 1_000_000
"""Largest accepted YAML file, bytes; the longest of ours has 22 kB."""
MAX_DEPTH = 40
"""Mappings and lists within each other."""
MAX_VALUES = 50_000
"""Values and keys in a file, those that an alias repeats counted again."""
MAX_DIGITS = 100
"""Characters of a number."""
MAX_WHOLE = 2**63 - 1

_Loader: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)  # the fast one, where PyYAML was built with it
_SCALARS: Any = yaml.SafeLoader("")
_PREFIX = "tag:yaml.org,2002:"


def read_small(path: Path, max_bytes: int = MAX_BYTES) -> bytes:
    """All bytes of a regular file. Raises `BadInput` where it is none, cannot be read, or is too long."""
    try:
        found = path.stat()
        if not stat.S_ISREG(found.st_mode):
            raise BadInput(f"{path}: this is {_kind(found.st_mode)}, expected a file")
        with path.open("rb") as file:
            content = file.read(max_bytes + 1)
    except (OSError, ValueError) as error:  # a ValueError: NUL in the name
        raise BadInput(f"{path}: {getattr(error, 'strerror', None) or error}; name a file that can be read") from None
    if len(content) > max_bytes:
        raise BadInput(f"{path}: more than {max_bytes:,} bytes, which no file of this kind needs; is it another file?")
    return content


def read_yaml(path: Path) -> Any:
    """Reads a YAML file: mappings, lists, texts, finite numbers, booleans and null. Raises `BadInput`."""
    return parse_yaml(read_small(path), str(path))


def read_mapping(path: Path) -> dict[str, Any]:
    """Reads a YAML file of names and values. Raises `BadInput`, also where there is nothing in it."""
    found = read_yaml(path)
    if not isinstance(found, dict):
        raise BadInput(f"{path}: expected names and values, found {'nothing' if found is None else repr(found)[:60]}")
    return found


def parse_yaml(content: bytes | str, where: str) -> Any:
    """Reads a YAML text as `read_yaml` does. `where` names it in messages.

    As YAML 1.1, without tags; what looks like a date stays a text. Raises `BadInput` with the line.
    """
    try:
        text = content if isinstance(content, str) else content.decode("utf-8-sig")
        if len(text) > MAX_BYTES:
            raise BadInput(f"{where}: more than {MAX_BYTES:,} characters, which no file of this kind needs")
        return _Reader(where, yaml.parse(text, Loader=_Loader)).document()
    except UnicodeDecodeError as error:
        raise BadInput(f"{where}: byte {error.start} is not UTF-8, expected YAML as UTF-8 text") from None
    except yaml.YAMLError as error:
        mark, problem = getattr(error, "problem_mark", None), getattr(error, "problem", None) or str(error)
        line = f", line {mark.line + 1}, column {mark.column + 1}" if mark else ""
        raise BadInput(
            f"{where}{line}: not valid YAML: {problem}; check indentation, colons, quotes and brackets"
        ) from None


@dataclass
class _Reader:
    """Values out of the events of a parser; stops at the first that breaks a limit."""

    where: str
    events: Iterator[Any]
    values: int = 0
    anchors: dict[str, tuple[Any, int]] = field(default_factory=dict)
    """Anchors by name: the value, and how many values it is made of."""

    def document(self) -> Any:
        found, documents = None, 0
        for event in self.events:
            if isinstance(event, yaml.DocumentStartEvent):
                documents += 1
                if documents > 1:
                    self._refuse(event, "a second document begins, expected one")
                found = self._value(next(self.events), 0)
        return found

    def _refuse(self, event: Any, what: str) -> None:
        raise BadInput(f"{self.where}, line {event.start_mark.line + 1}: {what}")

    def _value(self, event: Any, depth: int) -> Any:
        before = self.values
        if isinstance(event, yaml.AliasEvent):
            return self._alias(event)
        self._count(event, 1)
        if depth > MAX_DEPTH:
            self._refuse(event, f"more than {MAX_DEPTH} levels within each other")
        if event.tag not in (None, "!"):
            self._refuse(event, f"the tag {shown(event.tag)}; write the value without a tag")
        if isinstance(event, yaml.ScalarEvent):
            value = self._scalar(event)
        elif isinstance(event, yaml.SequenceStartEvent):
            value = []
            while not isinstance(item := next(self.events), yaml.SequenceEndEvent):
                value.append(self._value(item, depth + 1))
        else:
            value = self._mapping(depth)
        if event.anchor is not None:
            self.anchors[event.anchor] = (value, self.values - before)
        return value

    def _alias(self, event: Any) -> Any:
        if event.anchor not in self.anchors:
            self._refuse(event, f"*{shown(event.anchor)} refers to an anchor that is not defined yet")
        value, size = self.anchors[event.anchor]
        self._count(event, size)
        return copy.deepcopy(value)  # who changes one of them changes no other

    def _count(self, event: Any, number: int) -> None:
        self.values += number
        if self.values > MAX_VALUES:
            self._refuse(event, f"more than {MAX_VALUES:,} values, those that aliases repeat counted again")

    def _mapping(self, depth: int) -> dict[Any, Any]:
        own: dict[Any, Any] = {}
        merged: dict[Any, Any] = {}
        while not isinstance(event := next(self.events), yaml.MappingEndEvent):
            key = self._value(event, depth + 1)
            value = self._value(next(self.events), depth + 1)
            if isinstance(key, list | dict):
                self._refuse(event, "a list or mapping as a key, expected a name")
            elif key == "<<" and event.implicit[0]:
                for part in reversed(value if isinstance(value, list) else [value]):
                    if not isinstance(part, dict):
                        self._refuse(event, "'<<' takes a mapping")
                    merged |= part
            elif key in own:
                self._refuse(event, f"the key {shown(key)} occurs twice")
            else:
                own[key] = value
        return merged | own

    def _scalar(self, event: Any) -> Any:
        tag = _SCALARS.resolve(yaml.ScalarNode, event.value, event.implicit).removeprefix(_PREFIX)
        if tag not in ("null", "bool", "int", "float"):
            return event.value
        if len(event.value) > MAX_DIGITS:
            self._refuse(event, f"a number of {len(event.value)} characters, expected at most {MAX_DIGITS}")
        try:
            value = _SCALARS.construct_object(yaml.ScalarNode(_PREFIX + tag, event.value))
        except (ValueError, ArithmeticError):
            value = math.nan
        if isinstance(value, float) and not math.isfinite(value):
            self._refuse(event, f"{shown(event.value)} is not finite, expected a number")
        if isinstance(value, int) and abs(value) > MAX_WHOLE:
            self._refuse(event, f"the whole number {shown(event.value)} is too large, expected at most 2^63")
        return value


def _kind(mode: int) -> str:
    kinds = ((stat.S_ISDIR, "a folder"), (stat.S_ISFIFO, "a pipe"), (stat.S_ISSOCK, "a socket"))
    return next((kind for of_kind, kind in kinds if of_kind(mode)), "a device")

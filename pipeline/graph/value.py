"""Values that travel on wires: small frozen dataclasses, each an array (or a few) and what it means."""

import dataclasses
import reprlib
from typing import Any, ClassVar, dataclass_transform

VALUE_TYPES: dict[str, type["Value"]] = {}
"""Every value class by its full name. Decoding looks names up here and nowhere else, so that a file can
never name a class that is not a value."""


@dataclass_transform(frozen_default=True, field_specifiers=(dataclasses.field,))
class Value:
    """Base of everything that travels on a wire. A subclass becomes a frozen dataclass by itself.

    Fields are arrays, numbers, strings, other values, and tuples, lists and string-keyed dicts of these: what
    `codec.py` can write. A field that older files lack comes last and has a default. `in_place` marks a
    large value that one stage updates in place; it is then not frozen, and the engine sees to it that nobody reads it
    too late. `grows` names array fields of such a value to which rows are added and nothing else is done: a checkpoint
    writes the new ones only. `bulky` marks what is too large to be kept over a whole log: it is never cached. `costly`
    marks what takes long to make: where it is made before the loop it is kept in the cache. `is_truth` marks what
    cannot be measured in the field. `reported` marks a result of the run, though no other stage reads it.
    """

    in_place: ClassVar[bool] = False
    grows: ClassVar[tuple[str, ...]] = ()
    bulky: ClassVar[bool] = False
    costly: ClassVar[bool] = False
    is_truth: ClassVar[bool] = False
    reported: ClassVar[bool] = False

    def __init_subclass__(cls, **kwargs: Any) -> None:
        super().__init_subclass__(**kwargs)
        dataclasses.dataclass(frozen=not cls.in_place, eq=False, repr=False)(cls)
        VALUE_TYPES[value_name(cls)] = cls

    def contradiction(self) -> str | None:
        """Describes fields that do not fit each other beyond what their annotations state; None where they fit."""
        return None

    def __repr__(self) -> str:
        """Its fields; of a large array type and shape, so that however much it holds is a line."""
        fields = (field.name for field in dataclasses.fields(type(self)))  # type: ignore[arg-type]
        return f"{type(self).__name__}({', '.join(f'{name}={_SHORT.repr(getattr(self, name))}' for name in fields)})"


class _Short(reprlib.Repr):
    def repr_ndarray(self, array: Any, level: int) -> str:
        return repr(array) if array.size <= 9 else f"<{array.dtype} of {array.shape}>"

    def repr_instance(self, thing: Any, level: int) -> str:
        return repr(thing)


_SHORT = _Short()


def value_name(cls: type) -> str:
    """The name under which a value class is written to files."""
    return f"{cls.__module__}.{cls.__qualname__}"


class Tick(Value):
    """One turn of the loop: its number, the time it is of, and its log.

    `stamp` is in nanoseconds (that of the tick's data); `log` counts the logs of the run from 0;
    `frame` is the record's number within its log; `first_of_log` is true where a new log begins.
    """

    index: int
    stamp: int
    log: int = 0
    frame: int = 0
    first_of_log: bool = False

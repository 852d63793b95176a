"""Contents of a value's fields (shape, range, what they count), stated at each field.

It is checked where a value is read from a file, and where a stage gives it (see `engine.call`).
"""

import dataclasses
import functools
import types
import typing
from collections.abc import Iterator, Mapping, Sequence
from typing import Annotated, Any, Literal, Union, get_args, get_origin

import numpy as np

from .ports import type_name
from .stage import Bounds
from .stored_rows import StoredRows
from .value import Value

MAX_MAGNITUDE = 1e15
"""No number of a field with a `Shape` or `Bounds` is larger: sums of its squares stay finite in single precision."""

MAX_SUM_ERROR = 1e-4
"""Largest difference of the sum of shares from 1: many in single precision."""

MAX_LENGTH_ERROR = 1e-3
"""Largest difference of a unit vector's length from 1."""


class Shape:
    """The sizes of an array, or the length of a sequence or value: `Annotated[Array, Shape("rows", 3)]`.

    A name is one size wherever it occurs among the fields of a value; "rows+1" is one more. The numbers of an array
    with a shape are finite, unless it states `finite=False`.
    """

    def __init__(self, *sizes: int | str, finite: bool = True) -> None:
        self.sizes, self.finite = sizes, finite

    def __str__(self) -> str:
        return f"({', '.join(map(str, self.sizes))}{',' if len(self.sizes) == 1 else ''})"


@dataclasses.dataclass(frozen=True)
class RowsOf:
    """Numbers of rows: each is from 0 to one less than the size of that name."""

    size: str


@dataclasses.dataclass(frozen=True)
class Starts:
    """Starts of the parts of something, and the end of the last: from 0, never descending, to the size of that name."""

    size: str


class Shares:
    """Non-negative weights that sum to 1; there may be none."""


class UnitRows:
    """Vectors (…, n) of length 1, or of zeros alone where there is nothing to describe."""


class Covariances:
    """Matrices (…, n, n) that are symmetric, with variances above zero and no negative eigenvalue."""


def violation(value: Value) -> str | None:
    """Describes the first field that does not hold what it states; None where each does."""
    return next(_wrong_fields(value), None)


def wrong_output(thing: Any, kind: Any, optional: bool) -> str | None:
    """Describes why an output violates its declared type; None where it does not."""
    if thing is None:
        return None if optional else f"is missing, expected {type_name(kind)}; write `{type_name(kind)} | None`"
    if not _is(thing, kind):
        return f"is {_shown(thing)}, expected {type_name(kind)}"
    wrong = violation(thing) if isinstance(thing, Value) else None
    return None if wrong is None else f"is not a valid {type(thing).__name__}: {wrong}"


def _wrong_fields(value: Value) -> Iterator[str]:
    sizes: dict[str, int] = {}
    cls: Any = type(value)
    fields = [(name, *_split(annotation), getattr(value, name)) for name, annotation in _annotations(cls).items()]
    for name, kind, marks, thing in fields:
        if not _is(thing, kind):
            yield f"'{name}' is {_shown(thing)}, not {type_name(kind)}"
            return
        for mark in marks:
            if isinstance(mark, Shape) and thing is not None:
                yield from _wrong_shape(name, thing, mark, sizes)
        if isinstance(thing, Value):
            yield from (f"'{name}': {wrong}" for wrong in _wrong_fields(thing))
    for name, _, marks, thing in fields:
        if thing is not None and any(isinstance(mark, Shape | Bounds) for mark in marks):
            yield from _wrong_numbers(name, thing, marks, sizes)
    contradiction = value.contradiction()
    if contradiction is not None:
        yield contradiction


@functools.cache
def _annotations(cls: type[Any]) -> dict[str, Any]:
    try:
        hints = typing.get_type_hints(cls, include_extras=True)
    except NameError:  # imported for type checkers only
        return {}
    return {field.name: hints[field.name] for field in dataclasses.fields(cls)}


def stored_fields(cls: type[Any]) -> set[str]:
    """The fields of a value class that may be `StoredRows`: they are read from its file where they are needed."""
    kinds = {name: _split(annotation)[0] for name, annotation in _annotations(cls).items()}  # type: ignore[arg-type]
    return {name for name, kind in kinds.items() if any(get_origin(one) is StoredRows for one in get_args(kind))}


def _split(annotation: Any) -> tuple[Any, tuple[Any, ...]]:
    if get_origin(annotation) is Annotated:
        return get_args(annotation)[0], get_args(annotation)[1:]
    return annotation, ()


def _is(thing: Any, kind: Any) -> bool:
    origin, arguments = get_origin(kind), get_args(kind)
    if origin is Annotated:
        return _is(thing, arguments[0])
    if origin in (Union, types.UnionType):
        return any(_is(thing, option) for option in arguments)
    if origin is Literal:
        return any(type(thing) is type(option) and thing == option for option in arguments)
    if origin is np.ndarray:
        wanted = get_args(arguments[1])[0] if len(arguments) > 1 and get_args(arguments[1]) else np.generic
        return isinstance(thing, np.ndarray) and thing.dtype.isnative and _is_number(thing.dtype, wanted)
    if origin is StoredRows:
        return isinstance(thing, StoredRows) and thing.dtype.isnative and _is_number(thing.dtype, arguments[0])
    if origin is tuple and Ellipsis not in arguments:
        return isinstance(thing, tuple) and len(thing) == len(arguments) and all(map(_is, thing, arguments))
    if origin in (tuple, list, Sequence):
        kinds = tuple if origin is tuple else list if origin is list else (tuple, list)
        return isinstance(thing, kinds) and all(_is(item, arguments[0]) for item in thing)
    if origin in (dict, Mapping):
        return isinstance(thing, dict) and all(_is(k, arguments[0]) and _is(v, arguments[1]) for k, v in thing.items())
    if kind is float:
        return isinstance(thing, int | float | np.integer | np.floating) and not isinstance(thing, bool)
    if kind is int:
        return isinstance(thing, int | np.integer) and not isinstance(thing, bool)
    if kind is None or kind is Any:
        return thing is None or kind is Any
    return isinstance(thing, kind) if isinstance(kind, type) else True


def _is_number(dtype: np.dtype[Any], wanted: Any) -> bool:
    return not isinstance(wanted, type) or np.issubdtype(dtype, wanted)


def _shown(thing: Any) -> str:
    if isinstance(thing, np.ndarray | StoredRows):
        return f"an array of {thing.dtype}"[:60]
    return type(thing).__name__ if isinstance(thing, Value | list | tuple | dict | bytes) else f"{thing!r:.40}"


def _wrong_shape(name: str, thing: Any, shape: Shape, sizes: dict[str, int]) -> Iterator[str]:
    given = thing.shape if isinstance(thing, np.ndarray | StoredRows) else (len(thing),)
    expected = f"expected {shape}"
    fits = len(given) == len(shape.sizes)
    for size, stated in zip(given, shape.sizes, strict=False):
        if isinstance(stated, int):
            fits &= size == stated
        else:
            plain, _, more = stated.partition("+")
            known = sizes.setdefault(plain, size - int(more or 0))
            fits &= known >= 0 and size == known + int(more or 0)
            expected += f", {plain} = {known}"
    if not fits:
        yield f"'{name}' has the shape {given}, {expected}"


def _wrong_numbers(name: str, thing: Any, marks: Sequence[Any], sizes: Mapping[str, int]) -> Iterator[str]:
    numbers = np.asarray(thing) if isinstance(thing, np.ndarray | int | float | np.number) else np.empty(0)
    if numbers.dtype.kind not in "fO" and all(isinstance(mark, Shape) for mark in marks):
        return  # pixels, descriptors: as they are
    low, high = (float(numbers.min()), float(numbers.max())) if numbers.size else (0.0, 0.0)
    finite = all(mark.finite for mark in marks if isinstance(mark, Shape))
    if finite and numbers.dtype.kind in "fO" and not (low >= -MAX_MAGNITUDE and high <= MAX_MAGNITUDE):
        worst = high if low >= -MAX_MAGNITUDE else low
        yield f"'{name}' holds {worst:g}, expected finite numbers up to {MAX_MAGNITUDE:g}"
        return
    for mark in marks:
        if isinstance(mark, Bounds) and numbers.size:
            if mark.violated_by(low) or mark.violated_by(high):
                yield f"'{name}' holds {low if mark.violated_by(low) else high:g}, expected {mark}"
        elif isinstance(mark, RowsOf) and numbers.size and not (low >= 0 and high < sizes[mark.size]):
            yield f"'{name}' names a row that does not exist, expected 0 to {sizes[mark.size] - 1}"
        elif isinstance(mark, Starts):
            ends = numbers.size and numbers[0] == 0 and numbers[-1] == sizes[mark.size]
            if not ends or (np.diff(numbers) < 0).any():
                yield f"'{name}' does not ascend from 0 to {sizes[mark.size]}"
        elif isinstance(mark, Shares) and numbers.size:
            if low < 0 or abs(float(numbers.sum()) - 1.0) > MAX_SUM_ERROR:
                yield f"'{name}' holds {low:g} and sums to {float(numbers.sum()):g}, expected shares of 1"
        elif isinstance(mark, UnitRows) and numbers.size:
            lengths = np.linalg.norm(numbers, axis=-1).ravel()
            wrong = lengths[(np.abs(lengths - 1.0) > MAX_LENGTH_ERROR) & (lengths > 0.0)]
            if wrong.size:
                yield f"'{name}' holds a vector of length {wrong[0]:g}, expected 1"
        elif isinstance(mark, Covariances) and numbers.size:
            yield from _wrong_covariances(name, numbers)


def _wrong_covariances(name: str, matrices: Any) -> Iterator[str]:
    scale = np.abs(matrices).max(axis=(-1, -2))
    symmetric = np.abs(matrices - np.swapaxes(matrices, -1, -2)).max(axis=(-1, -2)) <= 1e-6 * scale
    positive = np.diagonal(matrices, axis1=-2, axis2=-1).min(axis=-1) > 0
    if not (symmetric & positive).all() or (np.linalg.eigvalsh(matrices)[..., 0] < -1e-9 * scale).any():
        yield f"'{name}' holds a matrix that is no covariance"

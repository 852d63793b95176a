"""Which value may go where: the only place with type rules, for wires and for parameters."""

import dataclasses
import inspect
import sys
import types
import typing
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal, Union, get_args, get_origin

import numpy as np

from .parameters import read_parameters, split_optional
from .problems import Problem, cut, nearest, suggest
from .stage import Bounds


def type_name(annotation: Any) -> str:
    """A type as people write it: `Particles`, `int >= 1`, `'sqrt' | 'none'`, `list of Value`."""
    origin = get_origin(annotation)
    if annotation is type(None):
        return "null"
    if annotation is Any:
        return "anything"
    if origin is Annotated:
        inner, *extras = get_args(annotation)
        return " ".join([type_name(inner), *(str(extra) for extra in extras if isinstance(extra, Bounds))])
    if origin is Literal:
        return " | ".join(repr(option) for option in get_args(annotation))
    if origin in (Union, types.UnionType):
        return " | ".join(type_name(option) for option in get_args(annotation))
    if origin is np.ndarray:
        return f"an array of {' '.join(type_name(kind) for kind in get_args(get_args(annotation)[1])) or 'numbers'}"
    if origin in (list, tuple, Sequence):
        items = [a for a in get_args(annotation) if a is not Ellipsis]
        if origin is tuple and Ellipsis not in get_args(annotation):
            return f"[{', '.join(type_name(item) for item in items)}]"
        return f"list of {type_name(items[0]) if items else 'anything'}"
    if origin in (dict, Mapping):
        inner = type_name(get_args(annotation)[1])
        return "mapping" if inner == "anything" else f"mapping to {inner}"
    return getattr(annotation, "__name__", str(annotation))


def compatible(given: Any, expected: Any) -> bool:
    """Tells whether a value of one type may enter a port of another: same class, subclass, or member of a union."""
    if expected is Any or given is Any:
        return True
    if get_origin(given) in (Union, types.UnionType):
        return all(compatible(option, expected) for option in get_args(given))
    if get_origin(expected) in (Union, types.UnionType):
        return any(compatible(given, option) for option in get_args(expected))
    if inspect.isclass(given) and inspect.isclass(expected):
        return issubclass(given, expected)
    return bool(given == expected)


class _Unfit(Exception):
    """Raised inside `convert` where a value does not fit; carries the problems found."""

    def __init__(self, problems: list[Problem]) -> None:
        self.problems = problems


def convert(value: Any, expected: Any, where: str) -> tuple[Any, list[Problem]]:
    """A plain configuration value as the type a parameter asks for, or the problems that prevent it.

    Whole numbers pass as floats, lists as tuples, mappings as dataclasses and texts as paths; nothing else is guessed.
    """
    try:
        return _convert(value, expected, where), []
    except _Unfit as unfit:
        return None, unfit.problems


def _unfit(value: Any, expected: Any, where: str, hint: str = "") -> _Unfit:
    given = "a mapping" if isinstance(value, Mapping) else cut(value)
    return _Unfit([Problem(where, f"{given} ({type(value).__name__}), expected {type_name(expected)}", hint)])


def _convert(value: Any, expected: Any, where: str) -> Any:
    origin, arguments = get_origin(expected), get_args(expected)
    if expected is Any:
        return value
    if origin is Annotated:
        try:
            converted = _convert(value, arguments[0], where)
        except _Unfit as unfit:
            if all(problem.where == where for problem in unfit.problems):
                raise _unfit(value, expected, where) from None  # so that the bounds are named too
            raise
        for bounds in (extra for extra in arguments[1:] if isinstance(extra, Bounds)):
            if isinstance(converted, int | float) and bounds.violated_by(converted):
                raise _Unfit([Problem(where, f"{cut(converted)} is out of bounds, expected {type_name(expected)}")])
        return converted
    if origin is Literal:
        if value in arguments and not isinstance(value, bool):
            return value
        if isinstance(value, bool) and any(option is value for option in arguments):
            return value
        hint = suggest(value, [str(a) for a in arguments], "choices") if isinstance(value, str) else ""
        raise _unfit(value, expected, where, hint)
    if origin in (Union, types.UnionType):
        return _convert_union(value, expected, where)
    if origin in (list, tuple, Sequence):
        return _convert_items(value, expected, where)
    if origin in (dict, Mapping):
        if not isinstance(value, Mapping):
            raise _unfit(value, expected, where)
        return {str(key): _convert(item, arguments[1], f"{where}.{key}") for key, item in value.items()}
    if dataclasses.is_dataclass(expected) and isinstance(expected, type):
        if isinstance(value, expected):
            return value
        if not isinstance(value, Mapping):
            raise _unfit(value, expected, where)
        arguments_found, problems = convert_fields(value, expected, where)
        if problems:
            raise _Unfit(problems)
        try:
            return expected(**arguments_found)
        except ValueError as error:  # what __post_init__ reports of them
            raise _Unfit([Problem(where, str(error))]) from None
    return _convert_plain(value, expected, where)


PLAIN: dict[Any, Any] = {
    **{kind: kind for kind in (type(None), bool, int, str, dict, list)},
    float: (int, float),
    Path: (str, Path),
}
"""Types of values that pass as each plain type; a bool passes as nothing else."""


def _convert_plain(value: Any, expected: Any, where: str) -> Any:
    if not isinstance(value, PLAIN.get(expected, ())) or (isinstance(value, bool) and expected is not bool):
        quotes = expected is str and type(value) in (int, float) and where[-1:] != "]"
        raise _unfit(value, expected, where, f"type '{where}=\"{value}\"' for a text" if quotes else "")
    if expected is float and not -sys.float_info.max <= value <= sys.float_info.max:
        raise _unfit(value, expected, where, "write a finite number")
    return expected(value) if expected in (float, Path) else value


def _convert_union(value: Any, expected: Any, where: str) -> Any:
    rest, optional = split_optional(expected)
    if optional and value is None:
        return None
    if optional:
        return _convert(value, rest, where)
    meant = _by_kind(value, get_args(expected), where)
    if meant is not None:
        return _convert(value, meant, where)
    several = []
    for option in get_args(expected):
        try:
            return _convert(value, option, where)
        except _Unfit as unfit:
            several.append(unfit.problems)
    shaped = [p for p in several if any(problem.where != where for problem in p)]
    names = [name for option in get_args(expected) if get_origin(option) is Literal for name in get_args(option)]
    near = nearest(value, map(str, names)) if isinstance(value, str) else None
    raise _Unfit(shaped[0]) if shaped else _unfit(value, expected, where, f"did you mean '{near}'?" if near else "")


def _by_kind(value: Any, options: Sequence[Any], where: str) -> Any:
    """The option of a union that a mapping means by its `kind`, where options are dataclasses that differ in it."""
    if not isinstance(value, Mapping) or "kind" not in value:
        return None
    groups = [option for option in options if dataclasses.is_dataclass(option) and isinstance(option, type)]
    kinds = {
        kind: option
        for option in groups
        if "kind" in (known := read_parameters(option))
        for kind in get_args(known["kind"].type)
    }
    if kinds and value["kind"] not in kinds:
        raise _unfit(
            value["kind"], Literal[tuple(kinds)], f"{where}.kind", suggest(str(value["kind"]), kinds, "choices")
        )
    return kinds.get(value["kind"])


def _convert_items(value: Any, expected: Any, where: str) -> Any:
    origin, arguments = get_origin(expected), get_args(expected)
    if not isinstance(value, list | tuple):
        raise _unfit(value, expected, where)
    if origin is tuple and Ellipsis not in arguments:
        if len(value) != len(arguments):
            raise _unfit(value, expected, where, f"give {len(arguments)} values")
        kinds = list(arguments)
    else:
        kinds = [arguments[0]] * len(value)
    items, problems = [], []
    for number, (item, kind) in enumerate(zip(value, kinds, strict=True)):
        try:
            items.append(_convert(item, kind, f"{where}[{number}]"))
        except _Unfit as unfit:
            problems += unfit.problems
    if problems:
        raise _Unfit(problems)
    return list(items) if origin is list else tuple(items)


def convert_fields(
    given: Mapping[Any, Any], expected: type[Any], where: str, skip: typing.Container[str] = ()
) -> tuple[dict[str, Any], list[Problem]]:
    """A mapping as the keyword arguments of a dataclass (a stage or a group of parameters), and every problem."""
    known = read_parameters(expected)
    arguments: dict[str, Any] = {}
    problems: list[Problem] = []
    above = f"{where}." if where else ""
    for name, value in given.items():
        if name in skip:
            continue
        path = f"{above}{name}"
        if name not in known:
            hint = suggest(str(name), known, "parameters", prefix=above)
            problems.append(Problem(path, f"{expected.__name__} has no parameter '{name}'", hint))
            continue
        arguments[name], found = convert(value, known[name].type, path)
        problems += found
    for name, parameter in known.items():
        if parameter.default is dataclasses.MISSING and name not in given:
            what = f"missing, expected {type_name(parameter.type)}"
            problems.append(Problem(f"{above}{name}", what, f"type {above}{name}=…"))
    return arguments, problems

"""Parameters of a class: its typed fields, with their meanings."""

import ast
import dataclasses
import functools
import inspect
import itertools
import sys
import types
import typing
from typing import Any, Union, get_args, get_origin


class BadStage(TypeError):
    """A stage class that cannot be read: names the class, what is wrong with it, and what to write."""


@dataclasses.dataclass(frozen=True)
class Parameter:
    """A parameter of a stage (or of a group of parameters): name, type with bounds, and default.

    `default` is `dataclasses.MISSING` where there is none; `owner` is the class that it was read from.
    """

    name: str
    type: Any
    default: Any
    owner: Any = None

    @property
    def meaning(self) -> str:
        """Meaning in one line: its attribute docstring, '' where it has none."""
        return attribute_docs(self.owner).get(self.name, "") if self.owner is not None else ""


def split_optional(annotation: Any) -> tuple[Any, bool]:
    """`X | None` -> (X, True); anything else -> (itself, False)."""
    if get_origin(annotation) in (Union, types.UnionType):
        rest = [a for a in get_args(annotation) if a is not type(None)]
        if len(rest) < len(get_args(annotation)):
            return (rest[0] if len(rest) == 1 else Union[tuple(rest)]), True  # noqa: UP007 - built at run time
    return annotation, False


def type_hints(thing: Any, cls: type) -> dict[str, Any]:
    """The annotations of a function or class that belongs to `cls`, by name. Raises `BadStage` for what is no type."""
    names = {name: value for base in reversed(cls.__mro__) for name, value in vars(base).items()}
    try:
        return typing.get_type_hints(thing, localns=names, include_extras=True)
    except NameError as error:
        raise BadStage(f"{cls.__module__}.{cls.__qualname__}: {error}; import the name at module level") from None
    except Exception as error:  # an annotation is evaluated, and may be any expression
        what = f"an annotation is no type: {type(error).__name__}: {error}"
        raise BadStage(f"{cls.__module__}.{cls.__qualname__}: {what}") from None


def read_parameters(cls: type[Any]) -> dict[str, Parameter]:
    """The typed fields of a dataclass with their defaults."""
    hints = type_hints(cls, cls)
    found = {}
    for field in dataclasses.fields(cls):
        default = field.default
        if default is dataclasses.MISSING and field.default_factory is not dataclasses.MISSING:
            default = field.default_factory()
        found[field.name] = Parameter(field.name, hints[field.name], default, cls)
    return found


@functools.cache
def attribute_docs(cls: type) -> dict[str, str]:
    """The docstrings below the fields of a class and of the classes it is derived from, each in one line.

    They are read off the source: Python itself does not keep them. A class without a source has none.
    """
    found: dict[str, str] = {}
    for base in reversed(cls.__mro__):
        if dataclasses.is_dataclass(base):
            found |= _docs_in(base)
    return found


def _docs_in(cls: type) -> dict[str, str]:
    try:
        source = inspect.getsource(sys.modules[cls.__module__])
    except (OSError, TypeError, KeyError):
        return {}
    found = {}
    for field, below in itertools.pairwise(_class_bodies(source).get(cls.__qualname__, ())):
        if isinstance(field, ast.AnnAssign) and isinstance(field.target, ast.Name) and isinstance(below, ast.Expr):
            text = below.value.value if isinstance(below.value, ast.Constant) else None
            if isinstance(text, str):
                found[field.target.id] = " ".join(text.split())
    return found


@functools.lru_cache(maxsize=16)
def _class_bodies(source: str) -> dict[str, list[ast.stmt]]:
    """The statements in each class of a module, by the class's qualified name."""
    found: dict[str, list[ast.stmt]] = {}
    waiting: list[tuple[str, ast.AST]] = [("", ast.parse(source))]
    while waiting:
        within, node = waiting.pop()
        for child in ast.iter_child_nodes(node):
            if isinstance(child, ast.ClassDef):
                found.setdefault(f"{within}{child.name}", child.body)
                waiting.append((f"{within}{child.name}.", child))
            elif isinstance(child, ast.FunctionDef | ast.AsyncFunctionDef):
                waiting.append((f"{within}{child.name}.<locals>.", child))
            elif isinstance(child, ast.stmt):
                waiting.append((within, child))
    return found


def first_line(thing: Any) -> str:
    """The first sentence-line of a docstring written for that thing, '' where it has none of its own."""
    text = vars(thing).get("__doc__") or ""
    if text.startswith(f"{thing.__name__}("):  # the text dataclasses put in where there is none
        return ""
    return text.strip().split("\n")[0].strip()

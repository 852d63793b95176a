"""Ports and parameters of a stage, read off its class and nowhere else."""

import ast
import dataclasses
import functools
import inspect
import itertools
import textwrap
import types
import typing
from collections.abc import Sequence
from typing import Annotated, Any, Union, get_args, get_origin

from .problems import cut
from .stage import Outputs, Source, Stage, State, Truth


@dataclasses.dataclass(frozen=True)
class Port:
    """An input or output: its name, the type of its value, and what may be missing."""

    name: str
    type: Any
    optional: bool = False
    collects: bool = False
    """True for an input declared `Sequence[X]`: `type` is then X."""
    keeps_gaps: bool = False
    """True for `Sequence[X | None]`: one entry per tick, None where the value was absent."""
    truth: bool = False
    """True for an output marked `Truth`."""


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


@dataclasses.dataclass(frozen=True)
class Signature:
    """Everything the graph needs to know of a stage class, read off the class itself."""

    inputs: dict[str, Port]
    outputs: dict[str, Port]
    parameters: dict[str, Parameter]
    state: tuple[str, type[State]] | None
    summary: str
    is_source: bool


class BadStage(TypeError):
    """A stage class that cannot be read: names the class, what is wrong with it, and what to write."""


def split_optional(annotation: Any) -> tuple[Any, bool]:
    """`X | None` -> (X, True); anything else -> (itself, False)."""
    if get_origin(annotation) in (Union, types.UnionType):
        rest = [a for a in get_args(annotation) if a is not type(None)]
        if len(rest) < len(get_args(annotation)):
            return (rest[0] if len(rest) == 1 else Union[tuple(rest)]), True  # noqa: UP007 - built at run time
    return annotation, False


def _hints(thing: Any, cls: type) -> dict[str, Any]:
    try:
        return typing.get_type_hints(thing, localns=dict(vars(cls)), include_extras=True)
    except NameError as error:
        raise BadStage(f"{cls.__module__}.{cls.__qualname__}: {error}; import the name at module level") from None


_SIGNATURES: dict[type[Stage], Signature] = {}


def signature(cls: type[Stage]) -> Signature:
    """Ports, parameters and state of a stage class.

    Raises `BadStage` where the class has no `step` that begins with `ctx`, an argument or a parameter without a type,
    a default that its own type refuses, or no readable `Out`.
    """
    if cls not in _SIGNATURES:
        _SIGNATURES[cls] = _read_signature(cls)
    return _SIGNATURES[cls]


def _read_signature(cls: type[Stage]) -> Signature:
    where = f"{cls.__module__}.{cls.__qualname__}"
    step = inspect.getattr_static(cls, "step", None)
    if not inspect.isfunction(step):
        raise BadStage(f"{where} has no step method; write `def step(self, ctx: Context, …) -> Out:`")
    hints = _hints(step, cls)
    inputs: dict[str, Port] = {}
    state: tuple[str, type[State]] | None = None
    arguments = list(inspect.signature(step).parameters.items())[1:]
    if not arguments or arguments[0][0] != "ctx":
        found = f"'{arguments[0][0]}'" if arguments else "missing"
        raise BadStage(f"{where}.step: its first argument is {found}; write `def step(self, ctx: Context, …)`")
    _refuse_untyped(cls, where)
    for name, argument in arguments[1:]:
        if name not in hints:
            raise BadStage(f"{where}.step: argument '{name}' has no type; write `{name}: SomeValue`")
        annotation, optional = split_optional(hints[name])
        if get_origin(annotation) is Annotated:
            annotation = get_args(annotation)[0]
        if inspect.isclass(annotation) and issubclass(annotation, State):
            state = (name, annotation)
            continue
        optional = optional or argument.default is not inspect.Parameter.empty
        collects, gaps = get_origin(annotation) is Sequence, False
        if collects:
            annotation, gaps = split_optional(get_args(annotation)[0])
        inputs[name] = Port(name, annotation, optional, collects, gaps)
    return Signature(
        inputs=inputs,
        outputs=_read_outputs(cls, hints.get("return"), where),
        parameters=_sound_parameters(cls, where),
        state=state,
        summary=first_line(cls),
        is_source=issubclass(cls, Source),
    )


def _refuse_untyped(cls: type[Stage], where: str) -> None:
    """Raise `BadStage` for a plain value in the body of a stage class: without a type it sets no parameter."""
    fields = {field.name for field in dataclasses.fields(cls)}  # type: ignore[arg-type]  # Stage makes it a dataclass
    constants = {name for base in cls.__mro__ for name in inspect.get_annotations(base)} - fields
    for base in cls.__mro__[: cls.__mro__.index(Stage)]:
        for name in vars(base).keys() - inspect.get_annotations(base).keys() - constants:
            value = vars(base)[name]
            plain = isinstance(value, int | float | str | tuple | list | dict | None)
            if plain and not name.startswith("_") and not name.isupper():
                typed = f"{name}: {type(value).__name__} = {cut(value)}"
                raise BadStage(f"{where}: '{name}' has no type, and so sets no parameter; write `{typed}`")


def _sound_parameters(cls: type[Stage], where: str) -> dict[str, Parameter]:
    """The parameters of a stage. Raises `BadStage` for a default that its type or bounds refuse."""
    from .ports import convert  # which reads parameters itself

    parameters = read_parameters(cls)
    for name, parameter in parameters.items():
        if parameter.default is not dataclasses.MISSING:
            problems = convert(parameter.default, parameter.type, name)[1]
            if problems:
                raise BadStage(f"{where}: the default of '{name}': {problems[0].what}; write another")
    return parameters


def _read_outputs(cls: type[Stage], returned: Any, where: str) -> dict[str, Port]:
    returned, _ = split_optional(returned)
    if returned is None or returned is type(None):
        if inspect.isclass(getattr(cls, "Out", None)):
            raise BadStage(f"{where}.step does not say that it gives its Out; write `-> Out`")
        return {}
    if not (inspect.isclass(returned) and issubclass(returned, Outputs)):
        raise BadStage(f"{where}.step returns {returned!r}; write a nested `class Out(Outputs)` and `-> Out`")
    hints = _hints(returned, cls)
    ports = {}
    for field in dataclasses.fields(returned):  # type: ignore[arg-type]  # Outputs makes it a dataclass
        annotation, *marks = get_args(hints[field.name]) if _is_annotated(hints[field.name]) else (hints[field.name],)
        annotation, optional = split_optional(annotation)
        truth = Truth in marks or bool(getattr(annotation, "is_truth", False))
        truth = truth or (field.name == "truth" and issubclass(cls, Source))
        optional = optional or field.default is not dataclasses.MISSING
        ports[field.name] = Port(field.name, annotation, optional, truth=truth)
    return ports


def _is_annotated(annotation: Any) -> bool:
    return get_origin(annotation) is Annotated


def read_parameters(cls: type[Any]) -> dict[str, Parameter]:
    """The typed fields of a dataclass with their defaults."""
    hints = _hints(cls, cls)
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
        source = inspect.getsource(cls)
    except (OSError, TypeError):
        return {}
    body = ast.parse(textwrap.dedent(source)).body[0]
    found = {}
    for field, below in itertools.pairwise(body.body if isinstance(body, ast.ClassDef) else []):
        if isinstance(field, ast.AnnAssign) and isinstance(field.target, ast.Name) and isinstance(below, ast.Expr):
            text = below.value.value if isinstance(below.value, ast.Constant) else None
            if isinstance(text, str):
                found[field.target.id] = " ".join(text.split())
    return found


def first_line(thing: Any) -> str:
    """The first sentence-line of a docstring written for that thing, '' where it has none of its own."""
    text = vars(thing).get("__doc__") or ""
    if text.startswith(f"{thing.__name__}("):  # the text dataclasses put in where there is none
        return ""
    return text.strip().split("\n")[0].strip()

"""Ports and parameters of a stage, read off its class and nowhere else."""

import dataclasses
import inspect
from collections.abc import Sequence
from typing import Annotated, Any, get_args, get_origin

from .parameters import BadStage, Parameter, first_line, read_parameters, split_optional, type_hints
from .ports import convert
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
class Signature:
    """Everything the graph needs to know of a stage class, read off the class itself."""

    inputs: dict[str, Port]
    outputs: dict[str, Port]
    parameters: dict[str, Parameter]
    state: tuple[str, type[State]] | None
    summary: str
    is_source: bool


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
    hints = type_hints(step, cls)
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
            for field in dataclasses.fields(annotation):  # type: ignore[arg-type]  # State makes it a dataclass
                if field.default is dataclasses.MISSING and field.default_factory is dataclasses.MISSING:
                    raise BadStage(f"{where}: '{field.name}' of its {annotation.__name__} has no default; write one")
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
    parameters = read_parameters(cls)
    for name, parameter in parameters.items():
        if parameter.default is not dataclasses.MISSING:
            problems = convert(parameter.default, parameter.type, name)[1]
            kind = parameter.type if inspect.isclass(parameter.type) else None
            if problems and kind not in (None, bool, int, float, str) and isinstance(parameter.default, kind):
                allowed = "numbers, words, Literal, tuples, or a Value of such"
                raise BadStage(f"{where}: '{name}' cannot be a {kind.__name__}; parameters are {allowed}")
            if problems:
                raise BadStage(f"{where}: the default of '{name}': {problems[0].what}; write another")
    return parameters


def _read_outputs(cls: type[Stage], returned: Any, where: str) -> dict[str, Port]:
    returned, _ = split_optional(returned)
    if returned is None or returned is type(None):
        if inspect.isclass(getattr(cls, "Out", None)):
            raise BadStage(f"{where}.step does not state that it gives its Out; write `-> Out`")
        return {}
    if not (inspect.isclass(returned) and issubclass(returned, Outputs)):
        raise BadStage(f"{where}.step returns {returned!r}; write a nested `class Out(Outputs)` and `-> Out`")
    hints = type_hints(returned, cls)
    ports = {}
    for field in dataclasses.fields(returned):  # type: ignore[arg-type]  # Outputs makes it a dataclass
        hint = hints[field.name]
        annotation, *marks = get_args(hint) if get_origin(hint) is Annotated else (hint,)
        annotation, optional = split_optional(annotation)
        truth = Truth in marks or bool(getattr(annotation, "is_truth", False))
        truth = truth or (field.name == "truth" and issubclass(cls, Source))
        optional = optional or field.default is not dataclasses.MISSING
        ports[field.name] = Port(field.name, annotation, optional, truth=truth)
    return ports

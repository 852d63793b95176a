"""A stage: a typed function with parameters. Ports and parameters are read off the class, and nowhere else."""

import dataclasses
import inspect
import types
import typing
from collections import Counter
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Union, dataclass_transform, get_args, get_origin

from .value import Tick

if TYPE_CHECKING:
    import numpy as np


@dataclasses.dataclass(frozen=True)
class Bounds:
    """Limits of a numeric parameter: `Annotated[int, Bounds(ge=1)]`."""

    ge: float | None = None
    gt: float | None = None
    le: float | None = None
    lt: float | None = None

    def violated_by(self, number: float) -> str | None:
        """The broken limit as text, or None."""
        for sign, limit, ok in (
            (">=", self.ge, self.ge is None or number >= self.ge),
            (">", self.gt, self.gt is None or number > self.gt),
            ("<=", self.le, self.le is None or number <= self.le),
            ("<", self.lt, self.lt is None or number < self.lt),
        ):
            if not ok:
                return f"{sign} {limit:g}"
        return None

    def __str__(self) -> str:
        limits = ((">=", self.ge), (">", self.gt), ("<=", self.le), ("<", self.lt))
        return " and ".join(f"{sign} {limit:g}" for sign, limit in limits if limit is not None)


class Truth:
    """Marks an output that no robot in the field would have: `pose: Annotated[Pose, Truth]`.

    Metrics and views may read it, and so may a graph over a recorded log; in a closed loop nothing that leads to a
    command may. A source's output named `truth` is marked by its name, and so is every output whose value type says so.
    """


@dataclass_transform(frozen_default=True, kw_only_default=True)
class Outputs:
    """Base of a stage's `Out` class: one field per output port. A field with a default may be absent (None)."""

    def __init_subclass__(cls, **kwargs: Any) -> None:
        super().__init_subclass__(**kwargs)
        dataclasses.dataclass(frozen=True, kw_only=True, eq=False)(cls)


@dataclass_transform(kw_only_default=True)
class State:
    """Base of a stage's scratch memory: mutable, seen by no other stage, kept in checkpoints.

    Every field needs a default. A stage gets its state by naming a parameter of that type in `step`.
    """

    def __init_subclass__(cls, **kwargs: Any) -> None:
        super().__init_subclass__(**kwargs)
        dataclasses.dataclass(kw_only=True, eq=False)(cls)


class Context:
    """What a stage may know beside its inputs.

    `rng` is the only source of randomness, seeded by the run's seed and the node's name. `tick` is the current
    turn of the loop. `folder` is the run's folder, where an "after" stage may put files (through `files.write_whole`).
    `count` and `fact` go into the manifest: things dropped, by kind, and things worth knowing about the run.
    `progress` (done, total or None) and `doing` (in words) are for a stage whose one step takes long: they are shown.
    """

    def __init__(self, node: str, rng: "np.random.Generator | None" = None, folder: Path | None = None) -> None:
        self.node = node
        self.folder = folder
        self.tick = Tick(index=0, stamp=0)
        self.counts: Counter[str] = Counter()
        self.details: dict[str, str] = {}
        self.facts: dict[str, Any] = {}
        self.drew = False
        self.read: frozenset[str] | None = None
        self.progress: Callable[[int, int | None], None] = lambda done, total: None
        self.doing: Callable[[str], None] = lambda words: None
        self._rng = rng

    def is_read(self, port: str) -> bool:
        """Whether anybody reads an output. What nobody reads may be left out, if nothing random is drawn for it."""
        return self.read is None or port in self.read

    @property
    def rng(self) -> "np.random.Generator":
        """The node's own generator. Touching it marks the run as one whose results depend on the seed."""
        if self._rng is None:
            import numpy as np

            self._rng = np.random.default_rng(0)
        self.drew = True
        return self._rng

    def count(self, kind: str, number: int = 1, detail: str = "") -> None:
        """Count something dropped or odd; the first `detail` of a kind is kept and said once."""
        self.counts[kind] += number
        if detail:
            self.details.setdefault(kind, detail)

    def fact(self, name: str, value: Any) -> None:
        """Put a fact about the run into the manifest (`odometry: synthetic`)."""
        self.facts[name] = value

    def generator_state(self) -> dict[str, Any]:
        """The bit generator's state as plain data."""
        return dict(self.rng_unmarked().bit_generator.state)

    def rng_unmarked(self) -> "np.random.Generator":
        """The generator, for the engine's own bookkeeping."""
        drew = self.drew
        rng = self.rng
        self.drew = drew
        return rng

    def notes(self) -> dict[str, Any]:
        """Counts, details and facts so far, as plain data."""
        return {
            "counts": dict(self.counts),
            "details": dict(self.details),
            "facts": dict(self.facts),
            "drew": self.drew,
        }

    def restore(self, generator: dict[str, Any], notes: dict[str, Any]) -> None:
        """Put back what `generator_state` and `notes` gave."""
        self.rng_unmarked().bit_generator.state = generator
        self.restore_notes(notes)

    def restore_notes(self, notes: dict[str, Any]) -> None:
        """Put back what `notes` gave."""
        self.counts, self.details = Counter(notes["counts"]), dict(notes["details"])
        self.facts, self.drew = dict(notes["facts"]), notes["drew"]


@dataclass_transform(kw_only_default=True)
class Stage:
    """Base of all stages. A subclass is a keyword-only dataclass of its parameters with a `step`.

    * parameters: annotated fields with defaults (`headings: Annotated[int, Bounds(ge=1)] = 36`);
    * input ports: the arguments of `step` after `ctx`; `X | None` is optional; `Sequence[X]` takes a `collect` wire and
      gets every present value, `Sequence[X | None]` one entry per tick;
    * scratch: an argument of `step` whose type is a `State`;
    * output ports: the fields of the nested class `Out(Outputs)`;
    * `setup(ctx)`: heavy work, once per run, before the first step;
    * `inputs_digest()`: for stages that read files, the content hash that caches and manifests use.

    A stage is pure when its outputs follow from its inputs alone: no State, no use of `ctx.rng`. Purity is what lets
    the engine keep the front of a graph (unwarped, featured images of a log) for the next run.
    """

    if TYPE_CHECKING:
        step: ClassVar[Callable[..., Any]]

    def __init_subclass__(cls, **kwargs: Any) -> None:
        super().__init_subclass__(**kwargs)
        dataclasses.dataclass(kw_only=True, eq=False)(cls)

    def setup(self, ctx: Context) -> None:
        """Heavy once-per-run work. The default does nothing."""

    def inputs_digest(self) -> str | None:
        """A content hash of the files this stage reads, or None where it reads none."""
        return None


class Source(Stage):
    """A stage that makes ticks. `Out` has a port `tick: Tick`; `step` returns None when there is no more.

    Its position is its `State`. A source may have delayed inputs only (a simulator takes the last command).
    """

    def length(self) -> int | None:
        """Number of ticks to come in all, where it is known (for the progress line). Called after `setup`."""
        return None


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
    """A parameter of a stage: name, type, bounds, default (`dataclasses.MISSING` where there is none)."""

    name: str
    type: Any
    default: Any


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

    Raises `BadStage` where the class has no `step`, an argument without a type, or no readable `Out`.
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
    for name, argument in list(inspect.signature(step).parameters.items())[1:]:
        if name == "ctx":
            continue
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
        parameters=read_parameters(cls),
        state=state,
        summary=first_line(cls),
        is_source=issubclass(cls, Source),
    )


def _read_outputs(cls: type[Stage], returned: Any, where: str) -> dict[str, Port]:
    returned, _ = split_optional(returned)
    if returned is None or returned is type(None):
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
        found[field.name] = Parameter(field.name, hints[field.name], default)
    return found


def first_line(thing: Any) -> str:
    """The first sentence-line of a docstring written for that thing, '' where it has none of its own."""
    text = vars(thing).get("__doc__") or ""
    if text.startswith(f"{thing.__name__}("):  # the text dataclasses put in where there is none
        return ""
    return text.strip().split("\n")[0].strip()

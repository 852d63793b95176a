"""A stage: a typed function with parameters."""

import dataclasses
import json
import operator
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, dataclass_transform

import numpy as np

from omninav.pipeline.files import digest_file, digest_text, user_path

from .value import Tick


@dataclasses.dataclass(frozen=True)
class Bounds:
    """Limits of a numeric parameter: `Annotated[int, Bounds(ge=1)]`."""

    ge: float | None = None
    gt: float | None = None
    le: float | None = None
    lt: float | None = None

    def violated_by(self, number: float) -> bool:
        """Tells whether a number breaks a limit; NaN breaks any."""
        return not all(getattr(operator, name)(number, limit) for name, limit in self._limits())

    def __str__(self) -> str:
        signs = {"ge": ">=", "gt": ">", "le": "<=", "lt": "<"}
        return " and ".join(f"{signs[name]} {limit:g}" for name, limit in self._limits())

    def _limits(self) -> list[tuple[str, float]]:
        return [(name, limit) for name, limit in vars(self).items() if limit is not None]


class Truth:
    """Marks an output that cannot be measured in the field: `state: Annotated[Reading, Truth]`.

    Metrics and views may read it, and so may a graph over a recorded log; in a closed loop nothing that leads to a
    command may. A source's output named `truth` is marked by its name, and so is every output whose value type is
    marked.
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
    """Context of a stage: all that it may know beside its inputs.

    `rng` is the only source of randomness, seeded by the run's seed and the node's name. `tick` is the current
    turn of the loop. `folder` is the run's folder, where an "after" stage may put files (through `files.write_whole`).
    `count`, `fact` and `warn` write to the manifest. `count` records dropped items by kind. `fact` records a value that
    describes the run. `warn` records what one must know to judge the results; it is also printed at the end of the run
    and stands at the head of its report.
    `progress` (done, total or None) and `status` (in words) are for a stage whose one step takes long: they are shown.
    """

    def __init__(self, node: str, rng: np.random.Generator | None = None, folder: Path | None = None) -> None:
        self.node = node
        self.folder = folder
        self.tick = Tick(index=0, stamp=0)
        self.counts: Counter[str] = Counter()
        self.details: dict[str, str] = {}
        self.facts: dict[str, Any] = {}
        self.run_facts: dict[str, Any] = {}
        self.warnings: list[str] = []
        self.used_rng = False
        self.read: frozenset[str] | None = None
        self.readers: dict[str, list[str]] = {}
        """By output, the nodes that read it tick by tick and lead to a delayed wire: what they give is kept."""
        self.progress: Callable[[int, int | None], None] = lambda done, total: None
        self.status: Callable[[str], None] = lambda words: None
        self._rng = rng

    def is_read(self, port: str) -> bool:
        """Tells whether an output is connected. An unconnected one may be skipped unless it consumes random numbers."""
        return self.read is None or port in self.read

    @property
    def rng(self) -> np.random.Generator:
        """The node's own generator. Touching it marks the run as one whose results depend on the seed."""
        self.used_rng = True
        return self.rng_unmarked() if self._rng is None else self._rng

    def count(self, kind: str, number: int = 1, detail: str = "") -> None:
        """Count something dropped or odd; the first `detail` of a kind is kept."""
        if not isinstance(kind, str):
            raise TypeError(f"ctx.count begins with a name for what is counted, not with {kind!r:.40}")
        self.counts[kind] += int(number)
        if detail:
            self.details.setdefault(kind, detail)

    def fact(self, name: str, value: Any, of_run: bool = False) -> None:
        """Put a fact about the run into the manifest (`noise: synthetic`), and into the files that the run makes.

        `of_run`: not into those, as it does not describe them (its pace). Raises `TypeError` for what JSON cannot hold.
        """
        try:
            json.dumps(value)
        except TypeError as error:
            raise TypeError(f"ctx.fact('{name}', …): {error}; give numbers, texts, lists or mappings of them") from None
        (self.run_facts if of_run else self.facts)[name] = value

    def warn(self, sentence: str) -> None:
        """Record a warning, once, that matters for judging the run's results."""
        if not isinstance(sentence, str):
            raise TypeError(f"ctx.warn takes a sentence, not {type(sentence).__name__}: {sentence!r:.40}")
        if sentence not in self.warnings:
            self.warnings.append(sentence)

    def generator_state(self) -> dict[str, Any]:
        """The bit generator's state as plain data."""
        return dict(self.rng_unmarked().bit_generator.state)

    def rng_unmarked(self) -> np.random.Generator:
        """The generator, for the engine's own bookkeeping."""
        if self._rng is None:
            self._rng = np.random.default_rng(0)
        return self._rng

    def notes(self) -> dict[str, Any]:
        """Counts, details and facts so far, as plain data."""
        return {
            "counts": dict(self.counts),
            "details": dict(self.details),
            "facts": dict(self.facts),
            "warnings": list(self.warnings),
            "drew": self.used_rng,
        }

    def restore(self, generator: dict[str, Any], notes: dict[str, Any]) -> None:
        """Put back what `generator_state` and `notes` gave."""
        self.rng_unmarked().bit_generator.state = generator
        self.restore_notes(notes)

    def restore_notes(self, notes: dict[str, Any]) -> None:
        """Put back what `notes` gave."""
        self.counts, self.details = Counter(notes["counts"]), dict(notes["details"])
        self.facts, self.used_rng = dict(notes["facts"]), notes["drew"]
        self.warnings = list(notes.get("warnings", ()))


@dataclass_transform(kw_only_default=True)
class Stage:
    """Base of all stages. A subclass is a keyword-only dataclass of its parameters with a `step`.

    * parameters: annotated fields with defaults (`points: Annotated[int, Bounds(ge=1)] = 36`), each with a docstring
      directly below it that says what it means;
    * input ports: the arguments of `step` after `ctx`; `X | None` is optional; `Sequence[X]` takes a `collect` wire and
      gets every present value, `Sequence[X | None]` one entry per tick;
    * scratch: an argument of `step` whose type is a `State`;
    * output ports: the fields of the nested class `Out(Outputs)`;
    * `setup(ctx)`: heavy work, once per run, before the first step;
    * `inputs_digest()`: for stages that read other files than those of their `Path` parameters, the content hash that
      caches and manifests use.

    A stage is pure when its outputs follow from its inputs alone: no State, no use of `ctx.rng`. Purity is what lets
    the engine keep the prefix of a graph (what follows from its logs alone) for the next run.
    """

    needs_all_plots: ClassVar[bool] = False
    """True for a stage that only draws, and is left out unless all plots are asked for (`plots=all`)."""

    if TYPE_CHECKING:
        step: ClassVar[Callable[..., Any]]

    def __init_subclass__(cls, **kwargs: Any) -> None:
        super().__init_subclass__(**kwargs)
        dataclasses.dataclass(kw_only=True, eq=False)(cls)

    def setup(self, ctx: Context) -> None:
        """Heavy once-per-run work. The default does nothing."""

    def inputs_digest(self) -> str | None:
        """A content hash of the files this stage reads, or None where it reads none.

        The default takes the files that parameters of type `Path` name.
        """
        names = [field.name for field in dataclasses.fields(self)]  # type: ignore[arg-type]  # Stage makes it a dataclass
        given = (getattr(self, name) for name in names)
        files = [path for value in given if isinstance(value, Path) and (path := user_path(value)).is_file()]
        return digest_text(*map(digest_file, files)) if files else None


class Source(Stage):
    """A stage that makes ticks. `Out` has a port `tick: Tick`; `step` returns None when there is no more.

    Its position is its `State`. A source may have delayed inputs only (a simulation takes the last command). One that
    is not `repeatable` gives other ticks in every run, or waits for them: nothing of it is cached, and no artifact is
    made from it.
    """

    repeatable: ClassVar[bool] = True

    def check(self, ctx: Context) -> None:
        """Raise `BadInput` where it can never give what is read of it (`ctx.readers`), before anything is run."""

    def length(self) -> int | None:
        """Number of ticks to come in all, where it is known (for the progress line). Called after `setup`."""
        return None

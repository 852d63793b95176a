"""Small stages for the tests of the framework, and graphs of them: numbers instead of robots."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np

from omninav.pipeline import Bounds, Context, MetricSpec, Outputs, Source, Stage, State, Tick, Truth, Value
from omninav.pipeline.files import digest_text, write_whole
from omninav.pipeline.graph.results import Metrics, Plot


class Number(Value):
    value: float


class Whole(Number):
    """A Number of a narrower kind."""


class Certainty(Value):
    share: Annotated[float, Bounds(ge=0, le=1)]


class Word(Value):
    text: str


class Big(Value):
    bulky = True
    array: np.ndarray


class Ledger(Value):
    """A large value that is updated in place."""

    in_place = True
    entries: list[float]


class Count(Source):
    """0, 1, 2, … ; every `gap`-th number is absent. Two logs where `logs` is 2."""

    length_: int = 10
    gap: int = 0
    logs: int = 1

    class Place(State):
        next: int = 0

    class Out(Outputs):
        tick: Tick
        number: Number | None = None
        big: Big

    def step(self, ctx: Context, place: Place) -> Out | None:
        index = place.next
        if index >= self.length_ * self.logs:
            return None
        place.next += 1
        log, frame = divmod(index, self.length_)
        tick = Tick(index, index * 10, log, frame, frame == 0)
        absent = self.gap and index % self.gap == self.gap - 1
        return self.Out(tick=tick, number=None if absent else Number(float(index)), big=Big(np.full(3, index)))

    def length(self) -> int | None:
        return self.length_ * self.logs


class Drive(Count):
    """Numbers that are computed, or read from where they were recorded."""

    place: str | None = None

    def recording_key(self) -> str | None:
        return None if self.place else digest_text("drive", str(self.length_))

    def recording_name(self) -> str:
        return f"a drive of {self.length_}"

    def record(self, ctx: Context, folder: Path) -> None:
        ctx.fact("length_m", self.length_)
        write_whole(folder / "drive.txt", str(self.length_))

    def replay(self, folder: Path) -> Mapping[str, Any]:
        return {"place": str(folder), "gap": None}


class GivesNumber(Stage):
    """Gives a number each time."""

    class Out(Outputs):
        number: Number


class Constant(GivesNumber):
    """A number that is there before the loop."""

    value: float = 0.0

    def step(self, ctx: Context) -> GivesNumber.Out:
        return self.Out(number=Number(self.value))


class Restart(Stage):
    """A number at the first tick of every log, nothing else."""

    value: float = 100.0

    class Out(Outputs):
        number: Number | None = None

    def step(self, ctx: Context, number: Number | None = None) -> Out:
        return self.Out(number=Number(self.value + ctx.tick.log) if ctx.tick.first_of_log else None)


class Scale(GivesNumber):
    """A number times a factor."""

    factor: Annotated[float, Bounds(gt=0, le=100)] = 1.0
    """What the number is multiplied by."""
    mode: Literal["plain", "negative"] = "plain"
    weights: tuple[float, ...] = ()

    def step(self, ctx: Context, number: Number) -> GivesNumber.Out:
        return self.Out(number=Number(number.value * self.factor * (-1 if self.mode == "negative" else 1)))


class Doubt(Stage):
    """Gives what no share can be, from a tick on."""

    since: int = 0
    """The tick."""

    class Out(Outputs):
        certainty: Certainty

    def step(self, ctx: Context, number: Number) -> Out:
        return self.Out(certainty=Certainty(float("nan") if ctx.tick.index >= self.since else 0.5))


class Scribble(Stage):
    """Writes into its input, from a tick on."""

    since: int = 0
    """The tick."""

    def step(self, ctx: Context, big: Big) -> None:
        big.array[0] += ctx.tick.index >= self.since


class Reuse(Stage):
    """Gives a number in one array, again and again."""

    class Out(Outputs):
        big: Big

    def setup(self, ctx: Context) -> None:
        self.array = np.zeros(3)

    def step(self, ctx: Context, number: Number) -> Out:
        self.array[0] = number.value
        return self.Out(big=Big(self.array))


class Noise(GivesNumber):
    """A number with noise from the stage's own generator."""

    def step(self, ctx: Context, number: Number) -> GivesNumber.Out:
        return self.Out(number=Number(number.value + ctx.rng.standard_normal()))


class Add(GivesNumber):
    """The sum of two numbers, the second of which may be missing."""

    def step(self, ctx: Context, number: Number, other: Number | None) -> GivesNumber.Out:
        return self.Out(number=Number(number.value + (other.value if other else 0.0)))


class Remember(GivesNumber):
    """Numbers seen so far, in a State."""

    class Seen(State):
        values: tuple = ()

    def step(self, ctx: Context, number: Number, seen: Seen) -> GivesNumber.Out:
        seen.values = (*seen.values, number.value)
        return self.Out(number=Number(float(len(seen.values))))


class NewLedger(Stage):
    """An empty ledger before the loop."""

    class Out(Outputs):
        ledger: Ledger

    def step(self, ctx: Context) -> Out:
        return self.Out(ledger=Ledger([]))


class Enter(Stage):
    """Adds a number to the ledger, in place."""

    class Out(Outputs):
        ledger: Ledger

    def step(self, ctx: Context, number: Number, ledger: Ledger) -> Out:
        ledger.entries.append(number.value)
        return self.Out(ledger=ledger)


class Look(GivesNumber):
    """How many entries the ledger has."""

    def step(self, ctx: Context, ledger: Ledger) -> GivesNumber.Out:
        return self.Out(number=Number(float(len(ledger.entries))))


class Say(Stage):
    """Takes a word."""

    def step(self, ctx: Context, word: Word) -> None:
        ctx.fact("said", word.text)


class Caption(Stage):
    """Takes a word and something big."""

    def step(self, ctx: Context, word: Word, big: Big) -> None: ...


class Spell(Stage):
    """A number as a word."""

    class Out(Outputs):
        word: Word

    def step(self, ctx: Context, number: Number) -> Out:
        return self.Out(word=Word(str(number.value)))


class Swallow(GivesNumber):
    """Takes bulky things."""

    def step(self, ctx: Context, big: Big) -> GivesNumber.Out:
        return self.Out(number=Number(float(big.array.sum())))


class Fail(GivesNumber):
    """Raises at a tick."""

    at: int = 3
    early: bool = False
    """It raises in `setup`, before the first tick."""

    def setup(self, ctx: Context) -> None:
        if self.early:
            raise RuntimeError("there is no wheel")

    def step(self, ctx: Context, number: Number) -> GivesNumber.Out:
        if ctx.tick.index == self.at:
            raise RuntimeError("the wheel fell off")
        return self.Out(number=number)


class Latest(Stage):
    """A result of every tick; the last one is that of the run."""

    class Out(Outputs):
        metrics: Metrics

    def step(self, ctx: Context, number: Number) -> Out:
        return self.Out(metrics=Metrics({"latest": number.value}))


class Collected(Stage):
    """All numbers, after the loop, as text in a file and as a metric."""

    name: str = "numbers.txt"

    class Out(Outputs):
        metrics: Metrics

    def step(self, ctx: Context, numbers: Sequence[Number | None], present: Sequence[Number] = ()) -> Out:
        values = [n.value if n is not None else None for n in numbers]
        if ctx.folder is not None:
            write_whole(ctx.folder / self.name, repr(values))
        described = {"numbers.present": MetricSpec(title="Present", context=True)}
        return self.Out(metrics=Metrics({"numbers": {"all": values, "present": len(present)}}, described))


class Draw(Stage):
    """Draws all numbers."""

    class Out(Outputs):
        plot: Plot

    def step(self, ctx: Context, numbers: Sequence[Number]) -> Out:
        return self.Out(plot=Plot("drawn", "All numbers", "As they came.", str(len(numbers)).encode()))


class DrawSlowly(Draw):
    """Draws all numbers where all plots are asked for."""

    needs_all_plots = True


class Total(GivesNumber):
    """The sum of all numbers, after the loop."""

    def step(self, ctx: Context, numbers: Sequence[Number | None]) -> GivesNumber.Out:
        return self.Out(number=Number(sum(number.value for number in numbers if number is not None)))


class Ledgers(GivesNumber):
    """How many ledgers there were."""

    def step(self, ctx: Context, ledgers: Sequence[Ledger]) -> GivesNumber.Out:
        return self.Out(number=Number(float(len(ledgers))))


class NotAStage:
    """Something that must never be called from a configuration."""

    called = False

    def __init__(self) -> None:
        type(self).called = True


class Steered(Source):
    """A number that goes where it is told; where it is, is truth."""

    class Place(State):
        at: float = 0.0
        ticks: int = 0

    class Out(Outputs):
        tick: Tick
        felt: Number
        truth: Number
        hidden: Annotated[Number | None, Truth] = None

    def step(self, ctx: Context, place: Place, command: Number | None = None) -> Out | None:
        if place.ticks == 10:
            return None
        place.at += command.value if command else 0.0
        place.ticks += 1
        tick = Tick(index=place.ticks - 1, stamp=place.ticks * 10**9, frame=place.ticks - 1)
        return self.Out(tick=tick, felt=Number(place.at), truth=Number(place.at), hidden=Number(place.at))


class Surveyed(Number):
    """A number that nobody inside the world has."""

    is_truth = True


class Surveyor(Stage):
    """Gives a plan of the world."""

    class Out(Outputs):
        plan: Surveyed

    def step(self, ctx: Context) -> Out:
        return self.Out(plan=Surveyed(1.0))


class Dice(GivesNumber):
    """A number that is drawn before the loop."""

    def step(self, ctx: Context) -> GivesNumber.Out:
        return self.Out(number=Number(float(ctx.rng.random())))


class Picky(Stage):
    """Refuses parameters that do not go together."""

    low: float = 0.0
    high: float = 1.0

    def __post_init__(self) -> None:
        if self.low > self.high:
            raise ValueError("low is above high")

    def step(self, ctx: Context) -> None:
        return None


class Tickless(Source):
    """A source that makes no ticks."""

    class Out(Outputs):
        number: Number

    def step(self, ctx: Context) -> Out | None:
        return None


def graph_of_toys(nodes: Mapping[str, Any], wires: object = None, **settings: object) -> dict[str, Any]:
    """A configuration whose nodes are named after toys: `Scale`, or `{"_target_": "Scale", "factor": 2.0}`."""
    spelled = {name: {"_target_": toy} if isinstance(toy, str) else toy for name, toy in nodes.items()}
    toys = {name: {**node, "_target_": f"toys.{node['_target_']}"} for name, node in spelled.items()}
    return {"nodes": toys, "wires": wires or {}, **settings}

"""What the engine costs per stage and tick, beside plain calls and beside a DAG library that runs the same graph."""

import os
import time
from collections.abc import Callable

from omninav.pipeline import Context, Outputs, Source, Stage, State, Tick, Value
from omninav.pipeline.engine.engine import Engine
from omninav.pipeline.graph.builder import build

from .table import Row, medians

TICKS = 2000
STAGES = 10


class Number(Value):
    """A number."""

    value: float


class Ticks(Source):
    """Ticks and a number."""

    class Place(State):
        next: int = 0

    class Out(Outputs):
        tick: Tick
        number: Number

    def step(self, ctx: Context, place: Place) -> Out | None:
        if place.next == TICKS:
            return None
        place.next += 1
        return self.Out(tick=Tick(place.next, place.next), number=Number(float(place.next)))


class AddOne(Stage):
    """One more."""

    class Out(Outputs):
        number: Number

    def step(self, ctx: Context, number: Number) -> Out:
        return self.Out(number=Number(number.value + 1.0))


def rows() -> list[Row]:
    """A chain of ten stages over 2000 ticks: the engine, plain calls of the same stages, Hamilton and Haystack."""
    here = __name__
    nodes = {"source": {"_target_": f"{here}.Ticks"}} | {f"s{i}": {"_target_": f"{here}.AddOne"} for i in range(STAGES)}
    wires = {f"s{i}": {"number": "source.number" if i == 0 else f"s{i - 1}.number"} for i in range(STAGES)}
    graph = build({"nodes": nodes, "wires": wires})
    stages = [AddOne() for _ in range(STAGES)]
    ctx = Context("plain")

    def engine() -> None:
        Engine(graph).run()

    def plain() -> None:
        source, place = Ticks(), Ticks.Place()
        while (out := source.step(ctx, place)) is not None:
            number = out.number
            for stage in stages:
                number = stage.step(ctx, number=number).number

    taken = medians({"engine": engine, "plain": plain}, rounds=7)
    per = 1e6 / (TICKS * STAGES)
    overhead = (taken["engine"] - taken["plain"]) * per
    what, peer = "engine overhead per stage and tick", "plain call of a stage"
    found = [Row(what, overhead, "us", peer, taken["plain"] * per, limit=20.0)]
    for name, measured in (("sf-hamilton", _hamilton()), ("haystack-ai", _haystack())):
        if measured is not None:
            what, peer = "engine, whole, per stage and tick", f"{name}, same graph"
            found.append(Row(what, taken["engine"] * per, "us", peer, measured, limit=1.0, of_peer=True))
    return found


def _hamilton() -> float | None:
    """Microseconds per stage and tick in Hamilton's driver, None where it is not installed."""
    try:
        from hamilton import ad_hoc_utils, driver
    except ImportError:
        return None

    def make(i: int):
        namespace: dict = {}
        before = f"s{i - 1}" if i else "number"
        exec(f"def s{i}({before}: float) -> float:\n    return {before} + 1.0", namespace)
        return namespace[f"s{i}"]

    module = ad_hoc_utils.create_temporary_module(*(make(i) for i in range(STAGES)), module_name="chain")
    chain = driver.Builder().with_modules(module).build()
    return _microseconds(lambda number: chain.execute([f"s{STAGES - 1}"], inputs={"number": number}))


def _haystack() -> float | None:
    """Microseconds per stage and tick in a Haystack pipeline, None where it is not installed."""
    os.environ.setdefault("HAYSTACK_TELEMETRY_ENABLED", "False")
    try:
        from haystack import Pipeline, component
    except ImportError:
        return None

    @component
    class OneMore:
        @component.output_types(number=float)
        def run(self, number: float) -> dict[str, float]:
            return {"number": number + 1.0}

    chain = Pipeline()
    for i in range(STAGES):
        chain.add_component(f"s{i}", OneMore())
        if i:
            chain.connect(f"s{i - 1}.number", f"s{i}.number")
    return _microseconds(lambda number: chain.run({"s0": {"number": number}}))


def _microseconds(run: Callable[[float], object], ticks: int = 60) -> float:
    """Measure the time of a chain per stage and tick, once it has run."""
    run(0.0)
    start = time.perf_counter()
    for tick in range(ticks):
        run(float(tick))
    return (time.perf_counter() - start) * 1e6 / (ticks * STAGES)

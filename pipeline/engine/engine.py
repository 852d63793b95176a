"""The engine: what runs before the loop, every tick, and after it.

`Engine.run` is the whole story on one screen. Everything a stage gave this tick lies in `values` under `node.port`;
delayed values wait in `channels`; what "after" stages collect goes to spools on disk.
"""

import math
import time
import zlib
from array import array
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from omninav.pipeline.graph.graph import ARTIFACTS, Graph, Node, Wire
from omninav.pipeline.graph.problems import BadInput
from omninav.pipeline.graph.stage import Context, Source, State

from . import checkpoint as checkpoints
from .checkpoint import Checkpoint
from .codec import encode_state, restore_state
from .disk_sequence import DiskSequence


class StageFailed(Exception):
    """A stage raised: which node, at which tick, and what. The cause is chained."""


class Front(Protocol):
    """The front of a graph: what its boundary gave, tick by tick, and before the loop (see `front.py`)."""

    nodes: frozenset[str]
    boundary: tuple[str, ...]
    replay: Sequence[Mapping[str, Any]] | None
    notes: Mapping[str, Mapping[str, Any]]
    before: Mapping[str, Any]


class Present(Sequence[Any]):
    """The present values of a spooled sequence, without the gaps."""

    def __init__(self, spool: DiskSequence) -> None:
        self._spool = spool
        self._where = [number for number, value in enumerate(spool) if value is not None]

    def __len__(self) -> int:
        return len(self._where)

    def __getitem__(self, index: Any) -> Any:
        if isinstance(index, slice):
            return [self._spool[number] for number in self._where[index]]
        return self._spool[self._where[index]]


class Channel:
    """A delayed wire's memory; wires with the same origin, delay and initial value share one.

    A value that is updated in place is there to stay: a tick at which its writer is skipped does not lose it.
    """

    def __init__(self, wire: Wire, in_place: bool) -> None:
        self.origin, self.delay, self.initial = wire.origin, wire.delay, wire.initial or ""
        self.hold = wire.hold or in_place
        self.waiting: deque[Any] = deque(maxlen=wire.delay)


def channel_key(wire: Wire) -> str:
    """The name under which a delayed wire's present value lies among `values`."""
    return f"{wire.origin}@{wire.delay}{'h' if wire.hold else ''}<{wire.initial}"


class Call:
    """A node made ready to run: where its inputs lie and where its outputs go."""

    def __init__(self, node: Node, wires: list[Wire], ctx: Context, static: set[str]) -> None:
        self.node, self.ctx = node, ctx
        self.step: Callable[..., Any] = node.stage.step
        self.state: State | None = node.signature.state[1]() if node.signature.state else None
        self.fixed: dict[str, Any] = {node.signature.state[0]: self.state} if node.signature.state else {}
        self.outputs = [(name, f"{node.name}.{name}") for name in node.signature.outputs]
        self.skips = f"skipped.{node.name}"
        self.inputs: list[tuple[str, str, str | None, bool]] = []
        for wire in wires:
            port = node.signature.inputs[wire.to_port]
            key, instead = wire.origin, None
            if wire.delay:
                key = channel_key(wire)
                instead = wire.initial if wire.initial not in static else None
            elif wire.hold:
                key = f"{wire.origin}#held"
            self.inputs.append((wire.to_port, key, instead, port.optional))
        self.times = array("d")  # seconds, one for each tick; NaN where it did not run

    def run(self, values: dict[str, Any]) -> bool:
        """Run the stage on the values of this tick and put its outputs there. False where a source has ended."""
        given = dict(self.fixed)
        for port, key, instead, optional in self.inputs:
            value = values.get(key)
            if instead is not None and values.get(instead) is not None:
                value = values[instead]
            if value is None and not optional:
                if self.node.lifetime != "before":  # there it is a choice, and nothing has been lost
                    self.ctx.counts[self.skips] += 1
                self.times.append(math.nan)
                for _, origin in self.outputs:
                    values[origin] = None
                return True
            given[port] = value
        start = time.perf_counter()
        try:
            out = self.step(self.ctx, **given)
        except BadInput:
            raise
        except Exception as error:
            raise StageFailed(self._said(error)) from error
        self.times.append(time.perf_counter() - start)
        for name, origin in self.outputs:
            values[origin] = getattr(out, name) if out is not None else None
        return out is not None

    def _said(self, error: Exception) -> str:
        tick = self.ctx.tick
        where = f"stage '{self.node.name}' ({self.node.target})"
        when = f" at tick {tick.index} (log {tick.log}, frame {tick.frame})" if self.node.lifetime == "tick" else ""
        return f"{where} failed{when}: {type(error).__name__}: {error}"


class Engine:
    """Runs a graph once, from the start or from a checkpoint.

    `artifacts` are the static values that wires name `artifacts.x`. `folder` is where "after" stages may write;
    `memory` is where checkpoints and spools live (None: nothing is kept, and nothing can be collected). `wanted` are
    outputs whose last value is returned by `run`. `recorded` outputs are spooled together, tick by tick, under the name
    `shared`. `progress` hears of every tick; it and `doing` hear what a stage with a long step says meanwhile.
    """

    def __init__(
        self,
        graph: Graph,
        artifacts: Mapping[str, Any],
        seed: int,
        folder: Path | None = None,
        memory: Path | None = None,
        wanted: Sequence[str] = (),
        identity: str = "",
        every_s: float = 5.0,
        front: Front | None = None,
        progress: Callable[[int, int | None], None] = lambda done, total: None,
        recorded: Sequence[str] = (),
        doing: Callable[[str], None] = lambda words: None,
    ) -> None:
        self.graph, self.memory, self.wanted, self.every_s = graph, memory, wanted, every_s
        self.identity, self.front, self.progress = identity, front, progress
        self.values: dict[str, Any] = {f"{ARTIFACTS}.{name}": value for name, value in artifacts.items()}
        static = set(self.values) | {f"{n.name}.{p}" for n in graph.of_lifetime("before") for p in n.signature.outputs}
        self.calls: dict[str, Call] = {}
        for node in graph.nodes.values():
            ctx = Context(node.name, np.random.default_rng([seed, zlib.crc32(node.name.encode())]), folder)
            ctx.progress, ctx.doing = progress, doing
            origins = [*wanted, *(o for wire in graph.wires for o in (wire.origin, wire.initial) if o)]
            ctx.read = frozenset(port for name, _, port in (o.partition(".") for o in origins) if name == node.name)
            wires = [wire for wire in graph.inputs_of(node.name) if not wire.collect]
            self.calls[node.name] = Call(node, wires, ctx, static)
        self.static = static
        self.channels = {
            channel_key(wire): Channel(
                wire, bool(getattr(getattr(graph.port(wire.origin), "type", None), "in_place", False))
            )
            for wire in graph.wires
            if wire.delay
        }
        ticking = {node.name for node in graph.of_lifetime("tick")}
        after = {node.name for node in graph.of_lifetime("after")}
        self.kept = {
            w.origin for w in graph.wires if w.from_node in ticking and (w.hold or w.to_node in after) and not w.collect
        }
        self.kept |= {origin for origin in wanted if origin.partition(".")[0] in ticking}
        self.spools: dict[str, DiskSequence] = {}
        self.together: dict[str, tuple[str, ...]] = {}
        if memory is not None:
            collected = {wire.origin for wire in graph.wires if wire.collect and wire.from_node in ticking}
            self.spools = {origin: DiskSequence(memory / f"{origin}.spool") for origin in sorted(collected)}
            if front is not None and front.replay is None:
                self.together["front"] = tuple(front.boundary)
            if recorded:
                self.together["shared"] = tuple(recorded)
            self.spools |= {name: DiskSequence(memory / f"{name}.spool") for name in self.together}
        self.ticks = 0
        self.ended = False

    def run(self) -> dict[str, Any]:
        """Before, every tick, after. Returns the last value of each wanted output (None where it was never present)."""
        replaying = self.front.nodes if self.front is not None and self.front.replay is not None else frozenset()
        for name, call in self.calls.items():
            if name not in replaying:
                call.node.stage.setup(call.ctx)
        for node in self.graph.of_lifetime("before"):
            if node.name not in replaying:
                self.calls[node.name].run(self.values)
        if replaying and self.front is not None:
            self.values.update(self.front.before)
        self._fill_channels()
        self._resume()
        for name in replaying:
            self.calls[name].ctx.restore_notes(dict(self.front.notes[name]))  # type: ignore[union-attr]
        if not self.ended:
            self._loop(replaying)
            self.ended = True
            self._save()
        for node in self.graph.of_lifetime("after"):
            self._run_after(node)
        return {origin: self.values.get(f"{origin}#held", self.values.get(origin)) for origin in self.wanted}

    def _loop(self, replaying: frozenset[str]) -> None:
        calls = [self.calls[node.name] for node in self.graph.of_lifetime("tick") if node.name not in replaying]
        source = self.graph.source
        if source is None:
            return
        total = len(self.front.replay) if self.front is not None and self.front.replay is not None else None
        if total is None and isinstance(source.stage, Source):
            total = source.stage.length()
        records = self._records()
        saved = time.monotonic()
        values, tick_key = self.values, f"{source.name}.tick"
        while True:
            for key, channel in self.channels.items():
                values[key] = channel.waiting[0] if channel.waiting else None
            if records is not None:
                record = next(records, None)
                if record is None:
                    return
                values.update(record)
                tick = values[tick_key]
            elif calls[0].run(values):
                tick = values[tick_key]
                calls[0].ctx.tick = tick
            else:
                return
            for call in calls if records is not None else calls[1:]:
                call.ctx.tick = tick
                call.run(values)
            self._end_tick()
            self.progress(self.ticks, total)
            if time.monotonic() - saved >= self.every_s:
                self._save()
                saved = time.monotonic()

    def _records(self) -> Iterator[Mapping[str, Any]] | None:
        if self.front is None or self.front.replay is None:
            return None
        replay = self.front.replay
        return (replay[number] for number in range(self.ticks, len(replay)))

    def _end_tick(self) -> None:
        values = self.values
        for origin in self.kept:
            if values[origin] is not None:
                values[f"{origin}#held"] = values[origin]
        for channel in self.channels.values():
            first = values.get(channel.initial) if channel.initial not in self.static else None
            if first is not None:
                channel.waiting.extend([first] * channel.delay)
            value = values[channel.origin]
            if value is None and channel.hold and channel.waiting:
                value = channel.waiting[-1]
            channel.waiting.append(value)
        for origin, spool in self.spools.items():
            together = self.together.get(origin)
            spool.append(values[origin] if together is None else {key: values[key] for key in together})
        self.ticks += 1

    def _fill_channels(self) -> None:
        for channel in self.channels.values():
            first = self.values.get(channel.initial) if channel.initial in self.static else None
            channel.waiting.extend([first] * channel.delay)

    def _run_after(self, node: Node) -> None:
        call = self.calls[node.name]
        fixed = dict(call.fixed)
        for wire in self.graph.inputs_of(node.name):
            port = node.signature.inputs[wire.to_port]
            if wire.collect:
                call.fixed[wire.to_port] = self._sequence(wire.origin, port.keeps_gaps)
            elif f"{wire.origin}#held" in self.values:
                self.values[wire.origin] = self.values[f"{wire.origin}#held"]
        call.run(self.values)
        call.fixed = fixed

    def _sequence(self, origin: str, gaps: bool) -> Sequence[Any]:
        if origin in self.spools:
            return self.spools[origin] if gaps else Present(self.spools[origin])
        value = self.values.get(origin)  # from a node that ran once: a sequence of one
        return [] if value is None else [value]

    # checkpoints

    def _save(self) -> None:
        if self.memory is None:
            return
        present = Checkpoint(
            identity=self.identity,
            ticks=self.ticks,
            ended=self.ended,
            replayed=self.front is not None and self.front.replay is not None,
            channels={key: list(channel.waiting) for key, channel in self.channels.items()},
            held={
                origin: self.values[f"{origin}#held"] for origin in sorted(self.kept) if f"{origin}#held" in self.values
            },
            states={name: encode_state(call.state) for name, call in self.calls.items() if call.state is not None},
            generators={name: call.ctx.generator_state() for name, call in self.calls.items()},
            notes={name: call.ctx.notes() for name, call in self.calls.items()},
            spools={name: spool.size for name, spool in self.spools.items()},
        )
        checkpoints.save(self.memory / "checkpoint", present)

    def _resume(self) -> None:
        path = self.memory / "checkpoint" if self.memory is not None else None
        if path is None or not path.exists():
            for spool in self.spools.values():
                spool.cut(0)
            return
        found = checkpoints.load(path)
        if found.replayed and (self.front is None or self.front.replay is None):
            for spool in self.spools.values():  # the cache it read from is gone: the same run, from its start
                spool.cut(0)
            return
        if found.identity != self.identity:
            raise BadInput(
                f"{path} belongs to another run (its configuration or its logs have changed): start a new run"
            )
        self.ticks, self.ended = found.ticks, found.ended
        for key, waiting in found.channels.items():
            self.channels[key].waiting.clear()
            self.channels[key].waiting.extend(waiting)
        self.values.update({f"{origin}#held": value for origin, value in found.held.items()})
        for name, fields in found.states.items():
            state = self.calls[name].state
            if state is not None:
                restore_state(state, fields)
        for name, call in self.calls.items():
            call.ctx.restore(found.generators[name], found.notes[name])
        for name, spool in self.spools.items():
            spool.cut(found.spools[name])

"""The engine: what runs before the loop, every tick, and after it.

`Engine.run` is the whole story: `begin`, `tick` until the source has ended, `finish`; who has the frames one at a time
calls these three. Everything a stage gave this tick is in `values` under `node.port`;
delayed values wait in `channels`; what "after" stages collect goes to sequences on disk.
"""

import time
import zlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from omninav.pipeline.graph.graph import ARTIFACTS, Graph, Node
from omninav.pipeline.graph.problems import BadInput
from omninav.pipeline.graph.stage import Context, Source

from . import checkpoint as checkpoints
from .call import Call, StageFailed
from .channel import Channel, channel_key, held_key
from .checkpoint import Checkpoint, OtherVersion
from .codec import BadEncoding, encode_state, restore_state
from .damage import report_damage
from .disk_sequence import DiskSequence, Present
from .grown_rows import GrownRows


@dataclass(frozen=True)
class EngineOptions:
    """Options of a run of a graph; none of them changes its results but the seed."""

    seed: int = 0
    """Seed of all randomness."""
    folder: Path | None = None
    """Folder in which "after" stages may write."""
    memory: Path | None = None
    """Folder of checkpoints and sequences; None: nothing is kept, and nothing can be collected."""
    identity: str = ""
    """Identity of the run, so that no other run continues from its checkpoint."""
    checkpoint_s: float = 5.0
    """Seconds between checkpoints."""
    on_tick: Callable[[int, int | None], None] = lambda done, total: None
    """Called after every tick, and by stages whose one step takes long."""
    on_status: Callable[[str], None] = lambda words: None
    """Called with what such a stage is doing, in words."""
    validate: bool = False
    """Whether every output of every tick is checked against what its type states, and not the first ones alone."""


@dataclass(frozen=True)
class PrefixReplay:
    """The first part of a graph, as it went before: nothing of it runs again."""

    nodes: frozenset[str]
    """Its nodes."""
    ticks: Sequence[Mapping[str, Any]]
    """Values that other nodes read of it, tick by tick."""
    notes: Mapping[str, Mapping[str, Any]]
    """Counts and facts of its nodes."""
    before: Mapping[str, Any]
    """Values that its nodes gave before the loop."""


class Engine:
    """Runs a graph once, from the start or from a checkpoint.

    `artifacts` are the static values that wires name `artifacts.x`. `wanted` are outputs whose last value is returned
    by `run`. `replay` replaces the first part of the graph. `recorded`: name -> outputs that are written together,
    tick by tick, to the sequence of that name.
    """

    def __init__(
        self,
        graph: Graph,
        artifacts: Mapping[str, Any] | None = None,
        options: EngineOptions | None = None,
        *,
        wanted: Sequence[str] = (),
        replay: PrefixReplay | None = None,
        recorded: Mapping[str, Sequence[str]] | None = None,
        kept: Sequence[str] = (),
    ) -> None:
        self.graph, self.wanted, self.kept, self.replay = graph, wanted, kept, replay
        self.options = options = options or EngineOptions()
        self.values: dict[str, Any] = {f"{ARTIFACTS}.{name}": value for name, value in (artifacts or {}).items()}
        self.static = {*self.values, *(origin for node in graph.of_lifetime("before") for origin in node.origins)}
        self.stateful = self.graph.leading_to([wire.origin for wire in graph.wires if wire.delay]).nodes
        self.calls = {node.name: self._call(node) for node in graph.nodes.values()}
        self.channels = {
            channel_key(wire): Channel(wire, graph.is_marked(wire.origin, "in_place"))
            for wire in graph.wires
            if wire.delay
        }
        ticking = {node.name for node in graph.of_lifetime("tick")}
        after = {node.name for node in graph.of_lifetime("after")}
        self.held = {
            w.origin for w in graph.wires if w.from_node in ticking and (w.hold or w.to_node in after) and not w.collect
        }
        self.held |= {origin for origin in wanted if origin.partition(".")[0] in ticking} | graph.reported(ticking)
        self.recorded = {name: tuple(origins) for name, origins in (recorded or {}).items()}
        self.sequences: dict[str, DiskSequence] = {}
        if options.memory is not None:
            collected = {wire.origin for wire in graph.wires if wire.collect and wire.from_node in ticking}
            names = [*sorted(collected.union(kept)), *self.recorded]
            self.sequences = {name: DiskSequence(options.memory / f"{name}.sequence") for name in names}
        self.source = graph.source
        self.ticks = 0
        self.ended = False
        self._given: set[str] = set()
        self._ticking: list[Call] = []
        self._total: int | None = None
        self._saved = 0.0
        self._rows = None if options.memory is None else GrownRows(options.memory)

    def _call(self, node: Node) -> Call:
        rng = np.random.default_rng([self.options.seed, zlib.crc32(node.name.encode())])
        ctx = Context(node.name, rng, self.options.folder)
        ctx.progress, ctx.status = self.options.on_tick, self.options.on_status
        read = {*self.wanted, *self.kept, *(origin for wire in self.graph.wires for origin in wire.origins)}
        ctx.read = frozenset(port for port in node.signature.outputs if f"{node.name}.{port}" in read)
        wires = [wire for wire in self.graph.inputs_of(node.name) if not wire.collect]
        for wire in self.graph.wires:
            if wire.from_node == node.name and not wire.collect and wire.to_node in self.stateful:
                ctx.readers.setdefault(wire.from_port, []).append(wire.to_node)
        return Call(node, wires, ctx, self.static, self.options.validate)

    def run(self) -> dict[str, Any]:
        """Before, every tick, after. Returns the last value of each wanted output (None where it was never present)."""
        self.begin()
        while self.tick():
            pass
        return self.finish()

    def give(self, origin: str, value: Any, notes: Mapping[str, Any]) -> None:
        """Take a value from before the loop, the only output of its node, as it was made in an earlier run."""
        node = origin.partition(".")[0]
        self.values[origin] = value
        self.calls[node].ctx.restore_notes(dict(notes))
        self._given.add(node)

    def begin(self) -> None:
        """Set up what runs, run what comes before the loop, and go back to the last checkpoint where there is one."""
        replayed = self.replay.nodes if self.replay is not None else frozenset()
        for name, call in self.calls.items():
            if name not in replayed:
                call.set_up()
        for node in self.graph.of_lifetime("before"):
            if node.name not in replayed and node.name not in self._given:
                self.calls[node.name].run(self.values)
        if self.replay is not None:
            self.values.update(self.replay.before)
        self._fill_channels()
        self._resume()
        if self.replay is not None:
            for name in replayed:
                self.calls[name].ctx.restore_notes(dict(self.replay.notes[name]))
        self._ticking = [self.calls[node.name] for node in self.graph.of_lifetime("tick") if node.name not in replayed]
        self._total = self._ticks_in_all()
        self._saved = time.monotonic()

    def check_source(self) -> None:
        """Let the source reject a graph that it can never serve, before the first tick. Raises `BadInput`."""
        source = self.source
        if source is not None and isinstance(source.stage, Source):
            source.stage.check(self.calls[source.name].ctx)

    def set_up_source(self) -> None:
        """Set up the source alone, which now reports on its inputs and their readers. Raises `BadInput`."""
        source = self.source
        if source is not None and isinstance(source.stage, Source) and source.stage.repeatable:
            self.calls[source.name].set_up()

    def tick(self) -> bool:
        """One turn of the loop. False where there is none: the source has ended."""
        if self.ended or self.source is None:
            return False
        values, calls = self.values, self._ticking
        for key, channel in self.channels.items():
            values[key] = channel.waiting[0] if channel.waiting else None
        if self.replay is not None:
            if self.ticks >= len(self.replay.ticks):
                return False
            values.update(self.replay.ticks[self.ticks])
        elif not calls[0].run(values):
            return False
        tick = values[f"{self.source.name}.tick"]
        if self.replay is None:
            last, calls[0].ctx.tick = calls[0].ctx.tick, tick
            if tick.log == last.log and not tick.first_of_log and tick.stamp < last.stamp:
                raise StageFailed(
                    f"stage '{self.source.name}' ({self.source.target}), tick {self.ticks}: its stamp {tick.stamp} ns "
                    f"is before that of the tick before, {last.stamp} ns; give ascending stamps, or begin another log"
                )
            calls = calls[1:]
        for call in calls:
            call.ctx.tick = tick
            call.run(values)
        self._end_tick()
        self.options.on_tick(self.ticks, self._total)
        if time.monotonic() - self._saved >= self.options.checkpoint_s:
            self.save()
        return True

    def finish(self) -> dict[str, Any]:
        """Runs the stages after the loop. Returns the last value of each wanted output."""
        if not self.ended:
            self.ended = True
            self.save()
        self._verify_sequences()
        for node in self.graph.of_lifetime("after"):
            self._run_after(node)
        return {origin: self.last(origin) for origin in self.wanted}

    def close(self) -> None:
        """Close the files of what is collected; nothing runs any more."""
        for sequence in self.sequences.values():
            sequence.close()
        if self._rows is not None:
            self._rows.close()

    def last(self, origin: str) -> Any:
        """The last present value of an output that is wanted or read after the loop; else that of the last tick."""
        return self.values.get(held_key(origin), self.values.get(origin))

    def _ticks_in_all(self) -> int | None:
        if self.replay is not None:
            return len(self.replay.ticks)
        source = self.source
        return source.stage.length() if source is not None and isinstance(source.stage, Source) else None

    def _end_tick(self) -> None:
        values = self.values
        for origin in self.held:
            if values[origin] is not None:
                values[held_key(origin)] = values[origin]
        for channel in self.channels.values():
            first = values.get(channel.initial) if channel.initial not in self.static else None
            if first is not None:
                channel.waiting.extend([first] * channel.delay)
            value = values[channel.origin]
            if value is None and channel.hold and channel.waiting:
                value = channel.waiting[-1]
            channel.waiting.append(value)
        for name, sequence in self.sequences.items():
            together = self.recorded.get(name)
            try:
                sequence.append(values[name] if together is None else {key: values[key] for key in together})
            except BadEncoding as error:
                raise StageFailed(f"'{name}' cannot be kept: {error}") from None
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
            elif held_key(wire.origin) in self.values:
                self.values[wire.origin] = self.values[held_key(wire.origin)]
        call.run(self.values)
        call.fixed = fixed

    def _sequence(self, origin: str, gaps: bool) -> Sequence[Any]:
        if origin in self.sequences:
            return self.sequences[origin] if gaps else Present(self.sequences[origin])
        value = self.values.get(origin)  # from a node that ran once: a sequence of one
        return [] if value is None else [value]

    # checkpoints

    def save(self) -> None:
        """Write a checkpoint, where there is a place for it."""
        if self.options.memory is None or self._rows is None:
            return
        self._saved = time.monotonic()
        held = {origin: held_key(origin) for origin in sorted(self.held)}
        present = Checkpoint(
            identity=self.options.identity,
            ticks=self.ticks,
            ended=self.ended,
            replayed=self.replay is not None,
            channels={key: list(channel.waiting) for key, channel in self.channels.items()},
            held={origin: self.values[key] for origin, key in held.items() if key in self.values},
            states={name: encode_state(call.state) for name, call in self.calls.items() if call.state is not None},
            generators={name: call.ctx.generator_state() for name, call in self.calls.items()},
            notes={name: call.ctx.notes() for name, call in self.calls.items()},
            sequences={name: sequence.size for name, sequence in self.sequences.items()},
        )
        try:
            checkpoints.save(self.options.memory / "checkpoint", present, self._rows)
        except BadEncoding:
            for call in self.calls.values():
                call.check_state()
            raise

    def _verify_sequences(self) -> None:
        """Check that the sequences hold exactly what the ticks gave, before anything is computed from them."""
        try:
            for sequence in self.sequences.values():
                sequence.verify(self.ticks)
        except BadEncoding as error:
            raise BadInput(f"{error}; `omninav resume` begins this graph again") from None

    def _whole_checkpoint(self) -> Checkpoint | None:
        """The last checkpoint, where it is whole and the sequences are with it, cut back to it."""
        path = self.options.memory / "checkpoint" if self.options.memory is not None else None
        if path is None or self._rows is None or not path.exists():
            return None
        try:
            found = checkpoints.load(path, self._rows)
            if found.replayed and self.replay is None:  # the cache it read from is gone
                return None
            if found.identity != self.options.identity:
                raise BadInput(
                    f"{path} belongs to another run (its configuration, its inputs, the code or a library has changed):"
                    " start a new run"
                )
            for name, sequence in self.sequences.items():
                sequence.cut(found.sequences.get(name, 0))
                sequence.verify(found.ticks)
        except OtherVersion as error:
            raise BadInput(str(error)) from None
        except BadEncoding as error:
            report_damage(f"{error}; this graph begins again at its first tick")
            return None
        return found

    def _resume(self) -> None:
        found = self._whole_checkpoint()
        if found is None:
            for sequence in self.sequences.values():
                sequence.cut(0)
            return
        self.ticks, self.ended = found.ticks, found.ended
        for key, waiting in found.channels.items():
            self.channels[key].waiting.clear()
            self.channels[key].waiting.extend(waiting)
        self.values.update({held_key(origin): value for origin, value in found.held.items()})
        for name, fields in found.states.items():
            state = self.calls[name].state
            if state is not None:
                restore_state(state, fields)
        for name, call in self.calls.items():
            call.ctx.restore(found.generators[name], found.notes[name])

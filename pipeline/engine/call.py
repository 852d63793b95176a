"""A node made ready to run: one call of its step each tick, from the tick's values and back into them."""

import inspect
import math
import random
import time
from array import array
from collections.abc import Callable
from typing import Any

import numpy as np

from omninav.pipeline.files import DISK
from omninav.pipeline.graph.contents import wrong_output
from omninav.pipeline.graph.graph import Node, Wire
from omninav.pipeline.graph.problems import HINTS, BadInput, one_line
from omninav.pipeline.graph.registry import BUILT_IN
from omninav.pipeline.graph.stage import Context, Outputs, State

from .channel import channel_key, held_key
from .codec import BadEncoding, encode, encode_state

VALIDATED_TICKS = 10
"""First calls of a stage of ours whose outputs are checked against what their types state; another's always are, since
a NaN may come late."""
GUARDED_EVERY = 8
"""Every so many calls of another's stage, and in its first `VALIDATED_TICKS`, its inputs and what it gave before must
be as they were, and the process' generators of random numbers; to look takes longer than a small stage."""


class StageFailed(Exception):
    """A stage raised, or gave what its output is not: which node, at which tick, and what. A cause is chained."""


class Call:
    """A node made ready to run: where its inputs are and where its outputs go."""

    def __init__(self, node: Node, wires: list[Wire], ctx: Context, static: set[str], validate: bool = False) -> None:
        self.node, self.ctx = node, ctx
        foreign = not node.target.startswith(f"{BUILT_IN}.")  # tests check ours
        self.to_check = math.inf if validate or foreign else VALIDATED_TICKS
        self.foreign = foreign
        self.step: Callable[..., Any] = node.stage.step
        self.state: State | None = node.signature.state[1]() if node.signature.state else None
        self.fixed: dict[str, Any] = {node.signature.state[0]: self.state} if node.signature.state else {}
        wired = {wire.to_port for wire in wires}
        for name, argument in inspect.signature(self.step).parameters.items():
            if name in node.signature.inputs.keys() - wired and argument.default is argument.empty:
                self.fixed[name] = None  # it is optional, or the graph would be refused
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
                key = held_key(wire.origin)
            self.inputs.append((wire.to_port, key, instead, port.optional))
        given = [wire for wire in wires if not getattr(node.signature.inputs[wire.to_port].type, "in_place", False)]
        each = [wire.to_port for wire in given if wire.origin not in static]
        self.guarded = each if node.lifetime == "tick" else []
        self.guarded_once = [wire.to_port for wire in given if wire.origin in static]  # these may be large
        growing = {name for name, port in node.signature.outputs.items() if getattr(port.type, "in_place", False)}
        self.guarded_outputs = [name for name in node.signature.outputs if name not in growing]
        self.gave: tuple[list[Any], bytes] | None = None
        self.times = array("d")  # seconds, one for each tick; NaN where it did not run

    def set_up(self) -> None:
        """Set up the stage. Raises `StageFailed` with its name for whatever it raises, but `BadInput`."""
        if self.foreign:
            self.check_state()
        try:
            self.node.stage.setup(self.ctx)
        except BadInput:
            raise
        except (Exception, SystemExit) as error:
            raise self._failed(error, f"stage '{self.node.name}' ({self.node.target}) failed in setup") from error

    def check_state(self) -> None:
        """Raise `StageFailed` for the first field of the stage's State that no checkpoint can hold."""
        for name, value in encode_state(self.state).items() if self.state is not None else ():
            try:
                encode(value)
            except BadEncoding as error:
                raise StageFailed(
                    f"stage '{self.node.name}' ({self.node.target}): field '{name}' of its State: {error}; a "
                    "State holds numbers, texts, arrays, Values and lists of them: make all else in setup"
                ) from None

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
        called = len(self.times)
        guards = self.foreign and (called < VALIDATED_TICKS or called % GUARDED_EVERY == 0)
        guarded = self.guarded + self.guarded_once if guards else []
        before = self._bytes([given[name] for name in guarded]) if guarded else b""
        generators = _generators() if guards else ()
        start = time.perf_counter()
        try:
            out = self.step(self.ctx, **given)
        except BadInput:
            raise
        except (Exception, SystemExit) as error:
            raise self._failed(error, self._place()) from error
        self.times.append(time.perf_counter() - start)
        if guards and _generators() != generators:
            self.ctx.used_rng = True  # the cache keeps what it gives for this seed alone
            self.ctx.warn(
                f"stage '{self.node.name}' ({self.node.target}) draws random numbers from numpy.random or random, "
                "which the run's seed does not decide: take them from ctx.rng"
            )
        if self.foreign and not called:
            self.check_state()
        if guarded and self._bytes([given[name] for name in guarded]) != before:
            raise StageFailed(f"{self._place()}: it changes its inputs, which others read too; write to a copy")
        if self.outputs and out is not None and not isinstance(out, Outputs):
            raise StageFailed(f"{self._place()}: step gave a value of type {type(out).__name__}, expected its Out")
        for name, origin in self.outputs:
            try:
                values[origin] = getattr(out, name) if out is not None else None
            except AttributeError:
                raise StageFailed(f"{self._place()}: step gave another Out than its own, without '{name}'") from None
        if self.gave is not None and self._bytes(self.gave[0]) != self.gave[1]:
            raise StageFailed(f"{self._place()}: it changes what it gave before, which is still read; give new arrays")
        self.gave = None
        if guards:
            given_out = [values[f"{self.node.name}.{name}"] for name in self.guarded_outputs]
            self.gave, self.guarded_once = (given_out, self._bytes(given_out)), []
        if self.to_check > 0 and out is not None:
            self.to_check -= 1
            self._check(out)
        return out is not None

    def _bytes(self, given: list[Any]) -> bytes:
        try:
            return encode(given)
        except BadEncoding as error:
            raise StageFailed(f"{self._place()}: {error}") from None

    def _check(self, out: Any) -> None:
        """Raise `StageFailed` for the first output that is not what its type states."""
        for name, port in self.node.signature.outputs.items():
            wrong = wrong_output(getattr(out, name), port.type, port.optional)
            if wrong is not None:
                raise StageFailed(one_line(f"{self._place()}: its output '{name}' {wrong}"))

    def _failed(self, error: BaseException, place: str) -> Exception:
        """The error that states which stage failed, and when."""
        try:
            message = f"{place}: {type(error).__name__}: {error}"
        except Exception as another:
            message = f"{place}: {type(error).__name__}, whose text cannot be had ({type(another).__name__})"
        if isinstance(error, OSError) and error.errno in DISK:
            return BadInput(f"{message}; {HINTS[error.errno]}; `omninav resume` continues the run")
        return StageFailed(message)

    def _place(self) -> str:
        tick = self.ctx.tick
        when = f" at tick {tick.index} (log {tick.log}, frame {tick.frame})" if self.node.lifetime == "tick" else ""
        return f"stage '{self.node.name}' ({self.node.target}) failed{when}"


def _generators() -> tuple[Any, ...]:
    """The states of the random numbers that a process shares."""
    state: Any = np.random.get_state(legacy=False)
    return random.getstate(), [np.asarray(each).tobytes() for each in state["state"].values()]

"""One check of everything that a stage promises, for a stage's own tests."""

import inspect
import types
from collections.abc import Iterator, Mapping, Sequence
from copy import deepcopy
from dataclasses import MISSING
from typing import Any, Union, get_args, get_origin

import numpy as np

from omninav.pipeline.engine.codec import BadEncoding, decode, encode, encode_state, restore_state
from omninav.pipeline.graph.contents import wrong_output
from omninav.pipeline.graph.parameters import BadStage, first_line
from omninav.pipeline.graph.signature import Signature, signature
from omninav.pipeline.graph.stage import Context, Stage, State
from omninav.pipeline.graph.value import Value

MIN_SUMMARY, MAX_SUMMARY = 21, 120
"""Characters of a docstring's first line, which tables show."""


def check_stage(
    stage: type[Stage] | Stage, frames: Sequence[Mapping[str, Any]] = (), seed: int = 0
) -> list[dict[str, Any]]:
    """Check that a stage keeps what the framework relies on, and give its outputs for some frames.

    The class: its ports and parameters can be read, its docstring begins with one line on what it does, every
    parameter is explained, ports carry `Value`s, and its State can be saved. With `frames` (inputs of `step` by
    name, one mapping a frame): outputs are what their types state, inputs are left as they were, the same seed gives
    the same outputs, and the stage continues from a saved State to the same outputs. Raises `AssertionError` with
    everything that is wrong.
    """
    cls = stage if inspect.isclass(stage) else type(stage)
    wrong = [*broken_promises(cls)] or [*_unfit_frames(stage, cls, frames)]
    outputs: list[dict[str, Any]] = []
    if not wrong and frames:
        made = stage() if inspect.isclass(stage) else stage
        wrong, outputs = _checked_steps(made, frames, seed)
    if wrong:
        raise AssertionError(f"{cls.__name__}:\n" + "\n".join(f"  {each}" for each in wrong))
    return outputs


def broken_promises(cls: type[Stage]) -> Iterator[str]:
    """Lists the faults of a stage class, as it is written."""
    try:
        read = signature(cls)
    except BadStage as error:
        yield str(error)
        return
    summary = first_line(cls)
    if not (MIN_SUMMARY <= len(summary) <= MAX_SUMMARY and summary.endswith(".")):
        size = f"{MIN_SUMMARY} to {MAX_SUMMARY} characters"
        yield f"its docstring begins with {summary!r:.60}, expected a sentence on one line, with a full stop, of {size}"
    for port in [*read.inputs.values(), *read.outputs.values()]:
        if not all(inspect.isclass(kind) and issubclass(kind, Value) for kind in _kinds(port.type)):
            yield f"port '{port.name}' is {port.type}, expected a class derived from Value"
    for parameter in read.parameters.values():
        if not parameter.meaning:
            yield f"parameter '{parameter.name}' is not explained; write a docstring below it"
    if read.state is not None:
        try:
            state = read.state[1]()
            restore_state(state, decode(encode(encode_state(state))))
        except (TypeError, BadEncoding) as error:
            yield f"its State cannot be saved from the first tick on: {error}"


def _unfit_frames(stage: type[Stage] | Stage, cls: type[Stage], frames: Any) -> Iterator[str]:
    """Reasons why `step` cannot be called with some frames."""
    read, step = signature(cls), inspect.signature(cls.step).parameters
    lacking = [name for name, each in read.parameters.items() if each.default is MISSING]
    if stage is cls and lacking and len(frames):
        yield f"{lacking[0]} has no default; check a stage that is made with it: {cls.__name__}({lacking[0]}=…)"
    if not isinstance(frames, Sequence):
        yield f"frames is a {type(frames).__name__}, expected a list with the inputs of each frame by name"
        return
    needed = {name for name in read.inputs if step[name].default is inspect.Parameter.empty}
    for number, frame in enumerate(frames):
        if not isinstance(frame, Mapping):
            yield f"frame {number} is a {type(frame).__name__}, expected its inputs by name: {', '.join(read.inputs)}"
        elif unknown := frame.keys() - read.inputs.keys():
            yield f"frame {number}: there is no input {', '.join(map(str, unknown))}; inputs: {', '.join(read.inputs)}"
        elif missing := needed - frame.keys():
            yield f"frame {number}: {', '.join(sorted(missing))} is missing; give None where there is none"


def _kinds(kind: Any) -> list[Any]:
    if get_origin(kind) in (Union, types.UnionType):
        return [inner for option in get_args(kind) for inner in _kinds(option)]
    return [inner for option in get_args(kind) if option is not ... for inner in _kinds(option)] or [kind]


def _checked_steps(
    stage: Stage, frames: Sequence[Mapping[str, Any]], seed: int
) -> tuple[list[str], list[dict[str, Any]]]:
    read, wrong = signature(type(stage)), []
    before = [encode(dict(frame)) for frame in frames]
    given: list[Any] = []
    outputs = _steps(stage, read, frames, seed, copies=given)
    for number, out in enumerate(outputs):
        for name, port in read.outputs.items():
            what = wrong_output(out[name], port.type, port.optional)
            if what is not None:
                wrong.append(f"frame {number}: output '{name}' {what}")
    if not any(port.type is not None and getattr(port.type, "in_place", False) for port in read.inputs.values()):
        after = [encode(dict(frame)) for frame in frames]
        wrong += [f"frame {n}: it changes its inputs" for n in range(len(frames)) if before[n] != after[n]]
    if not wrong and not any(getattr(port.type, "in_place", False) for port in read.outputs.values()):
        changed = [n for n, out in enumerate(outputs) if encode(out) != encode(given[n])]
        wrong += [f"frame {n}: its output is changed in a later frame; give a new array each time" for n in changed]
    if not wrong:
        first = encode(outputs)
        if encode(_steps(stage, read, frames, seed)) != first:
            wrong.append("with the same seed it gives other outputs; randomness comes from ctx.rng, memory is a State")
        elif encode(_steps(stage, read, frames, seed, again_at=len(frames) // 2)) != first:
            wrong.append("after its State was saved and restored it gives other outputs; keep all of it in the State")
    return wrong, outputs


def _steps(
    stage: Stage,
    read: Signature,
    frames: Sequence[Mapping[str, Any]],
    seed: int,
    again_at: int | None = None,
    copies: list[Any] | None = None,
) -> list[dict[str, Any]]:
    """The outputs for all frames; with `again_at` another copy of the stage continues there from what was saved.

    `copies` gets a copy of the outputs of each frame as they were then.
    """
    ctx = Context("checked", np.random.default_rng(seed))
    stage, state = _copy_of(stage, read, ctx)
    outputs = []
    for number, frame in enumerate(frames):
        if number == again_at:
            saved = encode([ctx.generator_state(), None if state is None else encode_state(state)])
            ctx = Context("checked", np.random.default_rng(seed))
            stage, state = _copy_of(stage, read, ctx)
            generator, fields = decode(saved)
            ctx.rng_unmarked().bit_generator.state = generator
            if state is not None:
                restore_state(state, fields)
        scratch = {} if read.state is None else {read.state[0]: state}
        out = stage.step(ctx, **frame, **scratch)
        outputs.append({name: None if out is None else getattr(out, name) for name in read.outputs})
        if copies is not None:
            copies.append(deepcopy(outputs[-1]))
    return outputs


def _copy_of(stage: Stage, read: Signature, ctx: Context) -> tuple[Stage, State | None]:
    copy = type(stage)(**{name: getattr(stage, name) for name in read.parameters})
    copy.setup(ctx)
    return copy, None if read.state is None else read.state[1]()

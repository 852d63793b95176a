"""Inputs of a run: the settings that a variant takes, and whether they are given."""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from omninav.pipeline.graph.ports import convert
from omninav.pipeline.graph.problems import Problem, ProblemsFound


@dataclass(frozen=True)
class Input:
    """A setting that a variant takes. In YAML, a plain string declares an optional input with that meaning."""

    meaning: str
    required: bool = False


def read_inputs(config: Mapping[str, Any]) -> dict[str, Input]:
    """The inputs that a plain configuration declares, but those that a variant takes out with null.

    Raises `ProblemsFound` where the block cannot be understood.
    """
    inputs = config.get("inputs") or {}
    if isinstance(inputs, Mapping):
        inputs = {name: given for name, given in inputs.items() if given is not None}
    declared, problems = convert(inputs, dict[str, str | Input], "inputs")
    if problems:
        raise ProblemsFound(problems)
    return {name: Input(given) if isinstance(given, str) else given for name, given in declared.items()}


def not_taken(config: Mapping[str, Any], settings: Iterable[str]) -> Iterator[Problem]:
    """Which of some settings are given and not taken by this variant: its metrics would be of something else."""
    inputs = read_inputs(config)
    for name in settings:
        if config.get(name) is not None and name not in inputs:
            takes = ", ".join(inputs) or "no input at all"
            hint = f"leave {name}=… out; its `inputs` are: {takes}"
            yield Problem(name, f"{config.get('variant')} does not take it", hint)


def refuse_missing(config: Mapping[str, Any]) -> None:
    """Raise `ProblemsFound` where an input is required and not given."""
    problems = [
        Problem(name, f"{config.get('variant')} needs it: {wanted.meaning}", f"type {name}=…")
        for name, wanted in read_inputs(config).items()
        if wanted.required and config.get(name) is None
    ]
    if problems:
        raise ProblemsFound(problems)

"""Reads what variants take off their files alone: to compose each of them as Hydra does takes seconds."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

from omninav.pipeline.graph.problems import BadInput
from omninav.pipeline.run.inputs import Input, read_inputs

Read = Callable[[str, str], Mapping[str, Any]]
"""The content of an option's file: of a group, and the option's name; {} where it has none."""


def inputs_of(variant: str, defaults: Sequence[Any], read: Read) -> dict[str, Input]:
    """The inputs that a variant and the options that it chooses declare, where `defaults` are those of `config.yaml`.

    Raises as `read_inputs`, and `BadInput` where its files include each other.
    """
    chosen = {"variant": variant}
    declared: dict[str, Any] = {}
    try:
        _choose("variant", variant, read, chosen)
        for group, option in (next(iter(item.items())) for item in defaults if isinstance(item, dict)):
            for inputs in _declared(group, chosen.get(group, option), read):
                declared |= inputs
    except RecursionError:
        raise BadInput(f"variant {variant}: its files include each other in their defaults") from None
    return read_inputs({"inputs": declared})


def _choose(group: str, option: str, read: Read, chosen: dict[str, str]) -> None:
    """Note what files override: the outermost counts, and of those beside each other the last."""
    items = read(group, option).get("defaults", [])
    for item in items:
        for name, value in item.items() if isinstance(item, dict) else ():
            chosen.setdefault(str(name).removeprefix("override ").lstrip("/"), value)
    for item in reversed(items):
        if item != "_self_" and isinstance(item, str):
            _choose(*_place(item, group), read, chosen)


def _declared(group: str, option: Any, read: Read) -> Iterator[Mapping[str, Any]]:
    """The `inputs` of a file and of those that it is made of, in the order in which they are merged."""
    content = read(group, option) if isinstance(option, str) else {}
    for item in [*(items := content.get("defaults", [])), *(["_self_"] if "_self_" not in items else [])]:
        if item == "_self_":
            yield content.get("inputs") or {}
        elif isinstance(item, str):
            yield from _declared(*_place(item, group), read)


def _place(item: str, group: str) -> tuple[str, str]:
    folder, _, name = item.rpartition("/")
    return folder.removeprefix("/") or group, name

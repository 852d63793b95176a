"""The parameters of every stage that ran, beside their defaults."""

import dataclasses
from dataclasses import dataclass

from omninav.pipeline.graph.graph import Graph


@dataclass(frozen=True)
class ParameterRow:
    """A parameter of a node: its value and its default as texts, what it means, and whether they differ."""

    node: str
    name: str
    value: str
    default: str
    meaning: str
    changed: bool


def parameter_rows(graph: Graph) -> list[ParameterRow]:
    """All parameters in the order of the graph."""
    rows = []
    for node in graph.nodes.values():
        for name, parameter in node.signature.parameters.items():
            stated = parameter.default
            default = _plain({} if stated is dataclasses.MISSING else stated)
            value = _plain(node.parameters.get(name, default))
            if isinstance(default, dict) and isinstance(value, dict):
                value = default | value  # of settings that belong together, some may be left out
            shown = "" if stated is dataclasses.MISSING else _text(default)
            rows.append(ParameterRow(node.name, name, _text(value), shown, parameter.meaning, value != default))
    return rows


def _plain(value: object) -> object:
    """A value as a configuration has it."""
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return {field.name: _plain(getattr(value, field.name)) for field in dataclasses.fields(value)}
    return [_plain(each) for each in value] if isinstance(value, tuple | list) else value


def _text(value: object) -> str:
    text = str(value)
    return text if len(text) <= 120 else f"{text[:119]}…"

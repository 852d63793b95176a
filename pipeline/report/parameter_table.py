"""The parameters of every stage that ran, beside their defaults."""

import dataclasses
from dataclasses import dataclass

from .drawn_graph import DrawnGraph


@dataclass(frozen=True)
class ParameterRow:
    """A parameter of a node: its value and its default as texts, what it means, and whether they differ."""

    node: str
    name: str
    value: str
    default: str
    meaning: str
    changed: bool


def parameter_rows(graph: DrawnGraph) -> list[ParameterRow]:
    """All parameters in the order of the graph."""
    rows = []
    for node in graph.nodes.values():
        for name, parameter in node.signature.parameters.items():
            default = "" if parameter.default is dataclasses.MISSING else _text(parameter.default)
            value = _text(node.parameters[name]) if name in node.parameters else default
            rows.append(ParameterRow(node.name, name, value, default, parameter.meaning, value != default))
    return rows


def _text(value: object) -> str:
    text = str(list(value) if isinstance(value, tuple) else value)
    return text if len(text) <= 120 else f"{text[:119]}…"

"""A graph as it is drawn: its boxes, ports and wires."""

from collections.abc import Mapping, Sequence
from typing import Any, Protocol

from omninav.pipeline.graph.signature import Signature

LIFETIMES = {"before": "before the loop", "tick": "every tick", "after": "after the last tick"}
"""The bands of a drawing."""


class DrawnNode(Protocol):
    """A node as it is drawn."""

    @property
    def name(self) -> str: ...
    @property
    def target(self) -> str: ...
    @property
    def lifetime(self) -> str: ...
    @property
    def signature(self) -> Signature: ...
    @property
    def parameters(self) -> Mapping[str, Any]: ...


class DrawnWire(Protocol):
    """A wire as it is drawn."""

    @property
    def to_node(self) -> str: ...
    @property
    def to_port(self) -> str: ...
    @property
    def from_node(self) -> str: ...
    @property
    def from_port(self) -> str: ...
    @property
    def delay(self) -> int: ...
    @property
    def hold(self) -> bool: ...
    @property
    def collect(self) -> bool: ...
    @property
    def initial(self) -> str | None: ...


class DrawnGraph(Protocol):
    """A graph as it is drawn."""

    @property
    def nodes(self) -> Mapping[str, DrawnNode]: ...
    @property
    def wires(self) -> Sequence[DrawnWire]: ...


def class_name(target: str) -> str:
    """`package.module.Stage` -> `Stage`."""
    return target.rpartition(".")[2]


def node_of(origin: str) -> str:
    """The node that an output `node.port` is of."""
    return origin.partition(".")[0]


def origins_of(wire: DrawnWire) -> list[str]:
    """The outputs that enter by a wire: its own, and that of its first value."""
    return [f"{wire.from_node}.{wire.from_port}", *([wire.initial] if wire.initial else [])]


def is_truth(graph: DrawnGraph, origin: str) -> bool:
    """Whether an output is ground truth."""
    node, _, port = origin.partition(".")
    given = graph.nodes[node].signature.outputs.get(port) if node in graph.nodes else None
    return given is not None and given.truth


def delay_in_words(wire: DrawnWire) -> str:
    """`one tick later`."""
    return "one tick later" if wire.delay == 1 else f"{wire.delay} ticks later"

"""A graph as data: nodes in running order, and the wires between them."""

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any, Literal

from .signature import Port, Signature
from .stage import Stage

Lifetime = Literal["before", "tick", "after"]
LIFETIMES: tuple[Lifetime, ...] = ("before", "tick", "after")
ARTIFACTS = "artifacts"
"""The name under which static values from files or other graphs' runs are wired: `artifacts.name`."""


def node_of(origin: str) -> str:
    """The node that an output `node.port` is of."""
    return origin.partition(".")[0]


@dataclass(frozen=True)
class Node:
    """A stage with its name, parameters and lifetime in a graph."""

    name: str
    target: str
    stage: Stage
    signature: Signature
    parameters: dict[str, Any]
    lifetime: Lifetime = "tick"

    @property
    def origins(self) -> list[str]:
        """`node.port` of each of its outputs."""
        return [f"{self.name}.{port}" for port in self.signature.outputs]


@dataclass(frozen=True)
class Wire:
    """A connection into a node's input port.

    `initial` is the `node.port` of a delayed wire's first value; None where that is absent.
    """

    to_node: str
    to_port: str
    from_node: str
    from_port: str
    delay: int = 0
    hold: bool = False
    collect: bool = False
    initial: str | None = None

    @property
    def origin(self) -> str:
        """`node.port` of the output it comes from."""
        return f"{self.from_node}.{self.from_port}"

    @property
    def origins(self) -> list[str]:
        """The outputs that enter by it: its own, and that of its first value."""
        return [self.origin, *([self.initial] if self.initial else [])]

    @property
    def where(self) -> str:
        """Its path in the configuration."""
        return f"wires.{self.to_node}.{self.to_port}"


@dataclass(frozen=True)
class Graph:
    """A checked graph. `nodes` are in the order in which they run within their lifetime."""

    nodes: dict[str, Node]
    wires: list[Wire]
    artifact_types: dict[str, Any] = field(default_factory=dict)

    def of_lifetime(self, lifetime: Lifetime) -> list[Node]:
        """The nodes of one lifetime, in running order."""
        return [node for node in self.nodes.values() if node.lifetime == lifetime]

    @property
    def source(self) -> Node | None:
        """The node that makes ticks, if there is one."""
        return next((node for node in self.nodes.values() if node.signature.is_source), None)

    def port(self, origin: str) -> Port | None:
        """The output port behind `node.port`, None where there is none."""
        node, _, name = origin.partition(".")
        if node == ARTIFACTS:
            kind = self.artifact_types.get(name)
            return None if kind is None else Port(name, kind, truth=bool(getattr(kind, "is_truth", False)))
        return self.nodes[node].signature.outputs.get(name) if node in self.nodes else None

    def is_marked(self, origin: str, mark: Literal["in_place", "bulky", "costly", "reported"]) -> bool:
        """Tells whether the values of an output are of a type that is marked so (see `Value`)."""
        port = self.port(origin)
        return port is not None and bool(getattr(port.type, mark, False))

    def is_truth(self, origin: str) -> bool:
        """Tells whether an output is ground truth (see `Truth`)."""
        port = self.port(origin)
        return port is not None and port.truth

    def reported(self, names: Iterable[str]) -> set[str]:
        """The outputs of some nodes that are results of a run, though no other node reads them."""
        return {o for name in names for o in self.nodes[name].origins if self.is_marked(o, "reported")}

    def inputs_of(self, name: str) -> list[Wire]:
        """The wires that enter a node."""
        return [wire for wire in self.wires if wire.to_node == name]

    def readers_of(self, origin: str) -> list[str]:
        """The nodes that read an output port, by any kind of wire. `readers_of("source.truth")` is who sees truth."""
        return sorted({wire.to_node for wire in self.wires if origin in wire.origins})

    def leading_to(self, origins: Iterable[str]) -> "Graph":
        """The part of the graph that some outputs depend on, by any kind of wire."""
        needed, waiting = set(), [*map(node_of, origins)]
        while waiting:
            name = waiting.pop()
            if name in needed or name not in self.nodes:
                continue
            needed.add(name)
            waiting += [node_of(origin) for wire in self.inputs_of(name) for origin in wire.origins]
        nodes = {name: node for name, node in self.nodes.items() if name in needed}
        return Graph(nodes, [wire for wire in self.wires if wire.to_node in needed], self.artifact_types)

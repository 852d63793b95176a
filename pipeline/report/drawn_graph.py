"""Names the bands of a drawn graph, and writes its nodes, outputs and wires as every drawing of it does."""

from omninav.pipeline.graph.graph import Graph, Wire

LIFETIMES = {"before": "before the loop", "tick": "every tick", "after": "after the last tick"}
"""The bands of a drawing."""


def class_name(target: str) -> str:
    """`package.module.Stage` -> `Stage`."""
    return target.rpartition(".")[2]


def node_of(origin: str) -> str:
    """The node that an output `node.port` is of."""
    return origin.partition(".")[0]


def origins_of(wire: Wire) -> list[str]:
    """The outputs that enter by a wire: its own, and that of its first value."""
    return [wire.origin, *([wire.initial] if wire.initial else [])]


def is_truth(graph: Graph, origin: str) -> bool:
    """Whether an output is ground truth."""
    given = graph.port(origin)
    return given is not None and given.truth


def delay_in_words(wire: Wire) -> str:
    """`one tick later`."""
    return "one tick later" if wire.delay == 1 else f"{wire.delay} ticks later"

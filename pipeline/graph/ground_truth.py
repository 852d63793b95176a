"""A closed loop is steered by what can be measured: nothing that leads to a command knows the truth."""

from collections.abc import Iterator

from .graph import Graph, Wire


def steering(graph: Graph) -> frozenset[str]:
    """The nodes that a source's next step depends on, by any kind of wire; empty where the source takes no input."""
    source = graph.source
    if source is None:
        return frozenset()
    return frozenset(graph.leading_to(o for wire in graph.inputs_of(source.name) for o in _origins(wire)).nodes)


def truth_in_the_loop(graph: Graph) -> Iterator[tuple[str, str, str]]:
    """Where, what and what to type for every wire that brings truth (see `Truth`) to a stage that steers the source.

    Metrics and plots, which no command depends on, may read it. An artifact is taken as it was made before.
    """
    for name in sorted(steering(graph)):
        for wire in graph.inputs_of(name):
            for origin in _origins(wire):
                if _is_truth(graph, origin):
                    what = f"{origin} is ground truth, and '{name}' steers the source: nothing measures it in the field"
                    yield wire.where, what, f"take the wire out: {wire.where}=null"


def _origins(wire: Wire) -> list[str]:
    return [wire.origin, *([wire.initial] if wire.initial else [])]


def truth_readers(graph: Graph) -> list[str]:
    """The nodes that read anything marked as truth, by any kind of wire."""
    return sorted({wire.to_node for wire in graph.wires if any(_is_truth(graph, o) for o in _origins(wire))})


def _is_truth(graph: Graph, origin: str) -> bool:
    port = graph.port(origin)
    return (port is not None and port.truth) or graph.is_marked(origin, "is_truth")

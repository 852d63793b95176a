"""A closed loop is steered by what can be measured: nothing that leads to a command knows the truth."""

from collections.abc import Iterator

from .graph import Graph


def steering(graph: Graph) -> frozenset[str]:
    """The nodes that a source's next step depends on, by any kind of wire; empty where the source takes no input."""
    source = graph.source
    if source is None:
        return frozenset()
    return frozenset(graph.leading_to(o for wire in graph.inputs_of(source.name) for o in wire.origins).nodes)


def truth_in_the_loop(graph: Graph) -> Iterator[tuple[str, str, str]]:
    """Places, problems and advice for every wire that brings truth (see `Truth`) to a stage that steers the source.

    Metrics and plots, which no command depends on, may read it. An artifact is taken as it was made before.
    """
    for name in sorted(steering(graph)):
        for wire in graph.inputs_of(name):
            for origin in wire.origins:
                if graph.is_truth(origin):
                    what = f"{origin} is ground truth, and '{name}' steers the source: nothing measures it in the field"
                    yield wire.where, what, f"take the wire out: {wire.where}=null"


def truth_readers(graph: Graph) -> list[str]:
    """The nodes that read anything marked as truth, by any kind of wire."""
    return sorted({wire.to_node for wire in graph.wires if any(map(graph.is_truth, wire.origins))})

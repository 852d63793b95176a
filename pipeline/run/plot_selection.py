"""Which plots a run draws: none, the few that are cheap, or all."""

from collections.abc import Iterable

from omninav.pipeline.graph.graph import Graph, Node
from omninav.pipeline.graph.results import Plot

PLOTS = ("auto", "few", "all", "none")
"""Values of `plots`: `auto` draws few, and none in a sweep."""


def with_plots(graph: Graph, plots: str, keep: Iterable[str]) -> Graph:
    """A graph without the nodes that only draw plots that were not requested, and without those that only they read.

    `keep`: nodes that stay in any case, because something of them is saved.
    """
    unwanted = {node.name for node in graph.nodes.values() if _only_draws(node) and not _is_drawn(node, plots)}
    kept, found = set(keep), set(unwanted)
    while found:
        found = {name for name in graph.nodes if name not in unwanted | kept and _only_for(graph, name, unwanted)}
        unwanted |= found
    if not unwanted:
        return graph
    nodes = {name: node for name, node in graph.nodes.items() if name not in unwanted}
    return Graph(nodes, [wire for wire in graph.wires if wire.to_node not in unwanted], graph.artifact_types)


def _only_draws(node: Node) -> bool:
    ports = node.signature.outputs.values()
    return node.lifetime != "tick" and bool(ports) and all(port.type is Plot for port in ports)


def _is_drawn(node: Node, plots: str) -> bool:
    return plots == "all" or (plots != "none" and not node.stage.needs_all_plots)


def _only_for(graph: Graph, name: str, unwanted: set[str]) -> bool:
    """Tells whether any node reads a node's outputs, and only those that are not wanted."""
    node = graph.nodes[name]
    readers = {reader for origin in node.origins for reader in graph.readers_of(origin)}
    return bool(readers) and readers <= unwanted and not node.signature.is_source and not graph.reported([name])

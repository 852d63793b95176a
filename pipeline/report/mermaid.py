"""A built graph as Mermaid text for Markdown."""

import re

from omninav.pipeline.graph.graph import Graph, node_of
from omninav.pipeline.graph.ground_truth import truth_readers

from .drawn_graph import LIFETIMES, class_name, delay_in_words

TRUTH = "#b3261e"
"""The colour of ground truth."""


def mermaid(graph: Graph) -> str:
    """The graph as a Mermaid flowchart. Delayed and initial wires are dotted, collected ones thick."""
    lines = ["flowchart LR"]
    outside = sorted({node_of(origin) for w in graph.wires for origin in w.origins} - set(graph.nodes))
    lines += [f"  {_id(name)}[({name})]" for name in outside]
    for lifetime, title in LIFETIMES.items():
        names = [node.name for node in graph.nodes.values() if node.lifetime == lifetime]
        if names:
            lines.append(f'  subgraph {lifetime}_band["{title}"]')
            lines += [f"    {_id(n)}[{_quoted(f'{n}<br/>{class_name(graph.nodes[n].target)}')}]" for n in names]
            lines.append("  end")
    joined: dict[tuple[str, str, str], list[str]] = {}
    for wire in graph.wires:
        name = wire.to_port if wire.from_port == wire.to_port else f"{wire.from_port} → {wire.to_port}"
        if wire.delay:
            joined.setdefault((wire.from_node, "-.", wire.to_node), []).append(f"{name}, {delay_in_words(wire)}")
        else:
            kind = "==" if wire.collect else "--"
            joined.setdefault((wire.from_node, kind, wire.to_node), []).append(name + (", held" if wire.hold else ""))
        if wire.initial:
            start, _, port = wire.initial.partition(".")
            joined.setdefault((start, "-.", wire.to_node), []).append(f"{port}, first value")
    arrow = {"--": "-->", "-.": ".->", "==": "==>"}
    for (start, kind, end), names in joined.items():
        lines.append(f"  {_id(start)} {kind} {_quoted('<br/>'.join(names))} {arrow[kind]} {_id(end)}")
    if readers := truth_readers(graph):
        lines.append(f"  classDef truth stroke:{TRUTH},stroke-width:2px")
        lines.append(f"  class {','.join(_id(name) for name in readers)} truth")
    return "\n".join(lines) + "\n"


def _id(name: str) -> str:
    return "n_" + re.sub(r"\W", "_", name)


def _quoted(text: str) -> str:
    return '"' + text.replace('"', "#quot;") + '"'

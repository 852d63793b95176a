"""`omninav graph`: the graph that a configuration describes, drawn."""

from pathlib import Path

from omninav.pipeline.cli.composition import complete, composed
from omninav.pipeline.files import write_whole
from omninav.pipeline.report.graph_svg import svg
from omninav.pipeline.report.mermaid import mermaid
from omninav.pipeline.run.prepared_run import prepare_run


def command(arguments: list[str]) -> int:
    """Write SVG and Mermaid of the graph and of those of its artifacts (`out=FOLDER`)."""
    out = next((Path(word.partition("=")[2]) for word in arguments if word.startswith("out=")), Path("."))
    arguments = [word for word in arguments if not word.startswith("out=")]
    with composed(arguments) as config:
        prepared = prepare_run(complete(config))
    drawn = {prepared.variant: prepared.graph} | {
        f"{prepared.variant}.{made.name}": made.graph for made in prepared.artifacts if made.graph
    }
    for name, graph in drawn.items():
        write_whole(out / f"{name}.svg", svg(graph))
        write_whole(out / f"{name}.mmd", mermaid(graph))
        print(f"{name}.svg and {name}.mmd (Mermaid), {len(graph.nodes)} nodes, written to {out.resolve()}")
    return 0

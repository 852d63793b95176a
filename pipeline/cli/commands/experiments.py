"""`omninav experiments`: tables of finished experiments and of papers' claims, written from verdict files."""

from pathlib import Path

from omninav.pipeline.experiment.index import write_index
from omninav.pipeline.graph.problems import BadInput


def command(arguments: list[str]) -> int:
    """Write the table of a folder's pages and that of the papers' claims."""
    if len(arguments) != 1:
        raise BadInput("experiments: name the folder with the pages: omninav experiments docs/experiments")
    for page in write_index(Path(arguments[0])):
        print(f"table: {page}")
    return 0

"""`omninav experiments`: tables of finished experiments and of papers' claims, written from verdict files."""

from pathlib import Path

from omninav.pipeline.experiment.index import write_index
from omninav.pipeline.graph.problems import BadInput


def command(arguments: list[str]) -> int:
    """Judge the pages in a folder by today's rule, and write their table and that of the papers' claims."""
    if len(arguments) != 1:
        raise BadInput("experiments: name the folder with the pages: omninav experiments docs/experiments")
    changed, pages = write_index(Path(arguments[0]))
    for name in changed:
        print(f"{name}: judged again")
    for page in pages:
        print(f"table: {page}")
    return 0

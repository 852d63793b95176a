"""`omninav experiments`: the table of finished experiments, written from their verdict files."""

from pathlib import Path

from omninav.pipeline.experiment.index import write_index
from omninav.pipeline.graph.problems import BadInput


def command(arguments: list[str]) -> int:
    """Judge the pages in a folder by today's rule, and write the table of them into its README.md."""
    if len(arguments) != 1:
        raise BadInput("experiments: name the folder with the pages: omninav experiments docs/experiments")
    folder = Path(arguments[0])
    for name in write_index(folder):
        print(f"{name}: judged again")
    print(f"table: {folder / 'README.md'}")
    return 0

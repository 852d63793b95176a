"""`omninav experiments`: the pages of finished experiments, and the list of papers' claims, from their result files."""

from pathlib import Path

from omninav.pipeline.cli.composed_experiments import judged_experiments
from omninav.pipeline.cli.composition import read_words
from omninav.pipeline.experiment.pages import CLAIMS, INDEX, pages
from omninav.pipeline.files import write_whole
from omninav.pipeline.graph.problems import BadInput


def command(arguments: list[str]) -> int:
    """Write a page for each result file of a folder, an index of them and what papers claim into another folder."""
    words, config_dirs = read_words(arguments)
    if len(words) != 2:
        hint = "omninav experiments docs/experiments build/experiments"
        raise BadInput(f"experiments: name the folder with results, and one for the pages: {hint}")
    results, folder = map(Path, words)
    written = pages(judged_experiments(results, config_dirs))
    folder.mkdir(parents=True, exist_ok=True)
    for name, content in written.items():
        write_whole(folder / name, content)
    print(f"index: {folder / INDEX}\nclaims: {folder / CLAIMS}")
    return 0

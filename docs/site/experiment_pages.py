"""Pages of experiments from their result files, and what pages include of them: tables, plots, counts of claims."""

import functools
import posixpath
import re
from pathlib import Path

from omninav.pipeline.cli.composed_experiments import judged_experiments
from omninav.pipeline.experiment.page import measure_table
from omninav.pipeline.experiment.pages import Judged, counts, pages, sources
from omninav.pipeline.experiment.plots import measure_plot
from omninav.pipeline.report.rendering import render

RESULTS = Path(__file__).parents[1] / "experiments"
INCLUDE = re.compile(r"^\{\{ (table|plot|claims) (.+) \}\}$", re.MULTILINE)
NAMED = re.compile(r"(?<!\[)`([a-z0-9_]+/[a-z0-9_]+)`")
"""An experiment's name as it is typed, not within a link."""
FENCES = re.compile(r"(^```.*?^```$)", re.MULTILINE | re.DOTALL)


@functools.cache
def judged() -> Judged:
    """All experiments with results."""
    return judged_experiments(RESULTS)


@functools.cache
def by_name() -> dict[str, int]:
    """Name as it is typed after `+experiment=` -> index among those that are judged."""
    commands = [re.search(r"\+experiment=(\S+)", result.command) for _, result in judged()]
    return {found[1]: index for index, found in enumerate(commands) if found}


def experiment_pages() -> dict[str, str | bytes]:
    """A page for each experiment, their index, the list of claims, and plots that other pages include."""
    found = pages(judged())
    for page in RESULTS.glob("*.md"):
        for kind, words in INCLUDE.findall(page.read_text(encoding="utf-8")):
            if kind == "plot":
                drawn = _plot(words)
                found[drawn.file] = drawn.content
    return {f"experiments/{name}": content for name, content in found.items()}


def with_results(markdown: str, page: str) -> str:
    """A page with its includes filled in, and experiments that it names linked to theirs."""
    parts = FENCES.split(INCLUDE.sub(_included, markdown))
    return "".join(
        part if FENCES.fullmatch(part) else NAMED.sub(functools.partial(_link, page), part) for part in parts
    )


def _link(page: str, match: re.Match[str]) -> str:
    index = by_name().get(match[1])
    if index is None:
        return match[0]
    place = f"experiments/{judged()[index][0].name}.md"
    return f"[{match[0]}]({posixpath.relpath(place, posixpath.dirname(page) or '.')})"


def _included(match: re.Match[str]) -> str:
    kind, words = match.groups()
    if kind == "claims":
        if words not in sources(judged()):
            raise ValueError(f"{match[0]}: there is no such paper, expected one of {', '.join(sources(judged()))}")
        return f"{counts(judged(), words)} Each judges the system as it was when measured: [all of them](claims.md)."
    if kind == "plot":
        drawn = _plot(words)
        return f"![{drawn.title}]({drawn.file})\n\n{drawn.caption}"
    name, measure = words.split()
    experiment, result = judged()[by_name()[name]]
    return render("measure_table.md", table=measure_table(experiment, result, measure))


@functools.cache
def _plot(words: str):  # type: ignore[no-untyped-def]
    name, measure = words.split()
    experiment, result = judged()[by_name()[name]]
    return measure_plot(experiment, result, measure, f"plot_of_{experiment.name}_{measure}")

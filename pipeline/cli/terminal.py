"""Tables and results on a terminal, and folders as one would type them."""

import shlex
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from omninav.pipeline.graph.results import Metrics
from omninav.pipeline.report.terminal_text import PlainTexts, Uncleaned
from omninav.pipeline.report.warning_lines import grouped, warning_lines
from omninav.pipeline.run.metrics_files import read_timing

NO_TERMINAL = 120
"""Columns of what is printed where there is no terminal."""


def show(renderable: Any) -> None:
    """Print a table or a text in the terminal's width; without one in `NO_TERMINAL` columns and no colour."""
    try:
        _console().print(PlainTexts(renderable))
    except SystemExit:  # so rich ends a program whose reader has gone
        raise BrokenPipeError from None


def terminal_width() -> int:
    """Columns in which `show` prints."""
    return int(_console().width)


def _console() -> Any:
    from rich.console import Console

    file: Any = Uncleaned(sys.stdout)
    return Console(file=file, width=None if sys.stdout.isatty() else NO_TERMINAL, highlight=False)


def show_results(folder: Path, metrics: Metrics, manifest: Mapping[str, Any]) -> None:
    """Print what one looks for first of a run that has ended, what it warns of, and where all of it is."""
    from omninav.pipeline.report.terminal_tables import key_table

    show(key_table(metrics, read_timing(folder)))
    for sentence in grouped(warning_lines(manifest)):
        print(f"warning: {sentence}", file=sys.stderr, flush=True)
    print(f"all metrics: omninav report {shlex.quote(shown(folder))}")
    show_report(folder)


def show_report(folder: Path) -> None:
    """Print where a run's report is."""
    print(f"report: {shown(folder / 'report.html')}", flush=True)


def shown(path: Path) -> str:
    """A path relative to the working directory, where it is below it."""
    try:
        return str(path.resolve().relative_to(Path.cwd()))
    except ValueError:
        return str(path)

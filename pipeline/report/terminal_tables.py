"""Results and comparisons as tables for the terminal."""

from collections.abc import Iterator, Mapping, Sequence
from string import ascii_uppercase
from typing import Any

from rich.table import Table as TerminalTable
from rich.text import Text

from omninav.pipeline.graph.results import Metrics

from .headlines import headline_rows
from .metrics import best_of, head_of, is_detail, metric_values
from .metrics_table import metrics_table
from .sweep_table import Overview

MAX_HEAD_LENGTH = 24
"""Longest run's name at the head of a column, in characters."""

_ABSENT = "–"
COLUMN_EDGE = 3
"""Columns of the terminal that a table's column takes beside its text."""


def key_table(metrics: Metrics, timing: Mapping[str, Any]) -> TerminalTable:
    """Headlines, a line each with its unit; what is off in colour, where there is any."""
    table = TerminalTable.grid(padding=(0, 3))
    for row in headline_rows(metrics, timing):
        table.add_row(Text(row.name), Text(row.text, "bold red" if row.off else ""))
    return table


def results_table(metrics: Metrics) -> TerminalTable:
    """All of a run's metrics with units, without their details."""
    found = metrics_table(metrics, details=False)
    table = TerminalTable(title="Results", title_justify="left", header_style="bold")
    table.add_column("")
    for column in found.columns or ("",):
        table.add_column(column, justify="right")
    for distribution in found.distributions:
        name = f"{distribution.name} ({distribution.unit})" if distribution.unit else distribution.name
        if len(distribution.rows) == 1:
            table.add_row(name, *distribution.rows[0].cells, style="bold cyan" if distribution.rows[0].plain else "")
            continue
        table.add_section()
        table.add_row(f"[bold]{name}[/bold]")
        for row in distribution.rows:
            table.add_row(f"  {row.condition}", *row.cells, style="bold cyan" if row.plain else "")
        table.add_section()
    for single in found.singles:
        table.add_row(single.name, single.text)
    return table


def sweep_table(sweep: Overview, width: int) -> TerminalTable:
    """Means over the seeds of each condition, with their 95 % intervals: as many metrics as fit in `width` columns."""
    table = TerminalTable(title="Means over seeds" if sweep.seeds else None, title_justify="left", header_style="bold")
    rows = sweep.conditions
    for number, name in enumerate(sweep.settings):
        head = name.replace(".", ".\n")  # else a long key would be broken inside a word
        table.add_column(head, overflow="fold")
        width -= max(*map(len, head.split()), *(len(row.settings[number]) for row in rows)) + COLUMN_EDGE
    fitting = 0
    for number, head in enumerate(sweep.heads):
        cells = max(len(row.cells[number]) for row in rows)
        width -= max(cells, *map(len, head.split())) + COLUMN_EDGE
        if width < COLUMN_EDGE and number:
            break
        table.add_column(head, justify="right")
        fitting += 1
    for row in rows:
        table.add_row(*row.settings, *row.cells[:fitting])
    return table


def compare_table(runs: Sequence[Mapping[str, Any]]) -> TerminalTable:
    """Several runs' metrics side by side, the best of each marked with *, and the settings in which they differ.

    A run holds `name`, `metrics` (`Metrics`), `config` and `manifest`.
    """
    heads, below = [str(run["name"]) for run in runs], ["* the best in its row"]
    if len({str(run["config"].get("log")) for run in runs}) > 1:
        below.append("these are runs of different logs")
    if max(map(len, heads)) > MAX_HEAD_LENGTH:  # folded names are hard to read: letters, and what they mean
        letters = [ascii_uppercase[n % 26] * (n // 26 + 1) for n in range(len(runs))]
        below = [*(f"{letter}: {name}" for letter, name in zip(letters, heads, strict=True)), *below]
        heads = letters
    table = TerminalTable(
        title="Comparison",
        title_justify="left",
        header_style="bold",
        caption="\n".join(below),
        caption_justify="left",
    )
    table.add_column("", overflow="fold")
    for head in heads:
        table.add_column(head, justify="right", overflow="fold")
    table.add_row("variant", *(str(run["manifest"].get("variant", "")) for run in runs))
    table.add_row("status", *(str(run["manifest"].get("status", "")) for run in runs))
    table.add_section()
    measured = [metric_values(run["metrics"]) for run in runs]
    shown = [
        [path for path in found if not is_detail(path, run["metrics"])]
        for run, found in zip(runs, measured, strict=True)
    ]
    for path in dict.fromkeys(path for paths in shown for path in paths):
        best = best_of(path, measured)
        cells = [found[path].text if path in found else "–" for found in measured]
        marked = [f"[bold green]{cell} *[/]" if n in best else f"{cell}  " for n, cell in enumerate(cells)]
        table.add_row(head_of(path, measured), *marked)
    table.add_section()
    for setting, values in differing_settings([run["config"] for run in runs]):
        table.add_row(f"[dim]{setting}[/]", *values)
    return table


def differing_settings(configs: Sequence[Mapping[str, Any]]) -> list[tuple[str, list[str]]]:
    """Dotted names of settings that are not the same in all configurations, with each one's value ('–': not there).

    Of stages that differ, or that one configuration lacks, the classes are given, and neither parameters nor wires.
    Artifacts of one graph are listed once.
    """
    found: dict[tuple[str, ...], tuple[str, list[str]]] = {}
    for name, values in _differing("", configs):
        own = name.split(".", 2)[-1] if name.startswith("artifacts.") else name
        found.setdefault((own, *values), (name, values))
    return list(found.values())


def _differing(name: str, values: Sequence[Any]) -> Iterator[tuple[str, list[str]]]:
    parts = [value for value in values if isinstance(value, Mapping)]
    if len(parts) == len(values) and len({str(part.get("_target_")) for part in parts}) == 1:
        for key in dict.fromkeys(key for part in parts for key in part):
            yield from _differing(f"{name}.{key}".lstrip("."), [part.get(key, _ABSENT) for part in parts])
    elif any(value != values[0] for value in values) and not (_ABSENT in values and ".wires." in f".{name}"):
        yield name, [_in_short(value) for value in values]


def _in_short(value: Any) -> str:
    return str(value.get("_target_", "…")).rpartition(".")[2] if isinstance(value, Mapping) else str(value)

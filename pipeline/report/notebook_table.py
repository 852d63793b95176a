"""A run's results as an HTML table, for notebooks."""

from collections.abc import Iterable
from html import escape

from omninav.pipeline.graph.results import Metrics

from .results import results


def notebook_table(metrics: Metrics) -> str:
    """What the terminal shows: quantities under each condition, then single numbers."""
    found = results(metrics, details=False)
    rows = [_row("th", ["", *found.columns])]
    for quantity in found.quantities:
        name = f"{quantity.name} ({quantity.unit})" if quantity.unit else quantity.name
        rows += [_row("td", [f"{name}, {row.condition}", *row.cells]) for row in quantity.rows]
    width = max(1, len(found.columns))
    for single in found.singles:
        value = f"{single.value} {single.unit}".strip()
        rows.append(_row("td", [single.name, value, *[""] * (width - 1)]))
    return f"<table>{''.join(rows)}</table>"


def _row(kind: str, cells: Iterable[str]) -> str:
    first, *others = cells
    inside = "".join(f"<{kind}>{escape(cell)}</{kind}>" for cell in others)
    return f'<tr><{kind} style="text-align:left">{escape(first)}</{kind}>{inside}</tr>'

"""A run's results as an HTML table, for notebooks."""

from collections.abc import Mapping
from html import escape
from typing import Any

from omninav.pipeline.graph.results import Metrics

from .key_figures import key_figures


def notebook_table(metrics: Metrics, timing: Mapping[str, Any]) -> str:
    """What the terminal shows: the figures that one looks for first."""
    rows = [
        f'<tr><td style="text-align:left">{escape(figure.name)}</td><td>{escape(figure.text)}</td></tr>'
        for figure in key_figures(metrics, timing)
    ]
    return f"<table>{''.join(rows)}</table>"

"""Results that any "after" stage may give: numbers for `metrics.json`, pictures and tables for the report."""

from typing import Any

from .value import Value


class Metrics(Value):
    """Figures of a run, merged into `metrics.json`. `values`: nested dicts of numbers, texts and None.

    The unit is the end of a name: `_m`, `_deg`, `_s`, `_px`, `_rate` (a share), `_bytes`.
    """

    values: dict[str, Any]


class Figure(Value):
    """A picture for the report. `content`: PNG or SVG bytes; `caption`: what it shows and what to look for.

    `name` is its file name without suffix; pictures are shown in the order of `order`, then of their names.
    """

    name: str
    title: str
    caption: str
    content: bytes
    media_type: str = "image/png"
    order: int = 50


class Table(Value):
    """A table for the report: column heads (with units), and rows of texts or numbers."""

    name: str
    title: str
    caption: str
    columns: tuple[str, ...]
    rows: tuple[tuple[Any, ...], ...]
    order: int = 50

"""Results that any "after" stage may give: numbers for `metrics.json`, pictures and tables for the report."""

from typing import Any

from .value import Value


class Metrics(Value):
    """Figures of a run, merged into `metrics.json`. `values`: nested dicts of numbers, texts and None.

    The unit is the end of a name: `_m`, `_deg`, `_s`, `_px`, `_rate` (a share), `_bytes`.
    """

    values: dict[str, Any]


class Figure(Value):
    """A picture for the report. `content`: PNG, JPEG or SVG bytes; `caption`: what it shows and what to look for.

    `name` is its file name without suffix; pictures are shown in the order of `order`, then of their names. A film is
    one too (`media_type` video/mp4): `per_second`, its frames in a second, lets the reader step through it.
    """

    name: str
    title: str
    caption: str
    content: bytes
    media_type: str = "image/png"
    order: int = 50
    per_second: float | None = None


class Table(Value):
    """A table for the report: column heads (with units), and rows of texts or numbers."""

    name: str
    title: str
    caption: str
    columns: tuple[str, ...]
    rows: tuple[tuple[Any, ...], ...]
    order: int = 50

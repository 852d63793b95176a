"""Values out of nested results: a path leads to a number or to a series of them, of which one value is taken."""

from collections.abc import Mapping, Sequence
from typing import Any, Literal

import numpy as np

Aggregate = Literal["mean", "median", "min", "max", "first", "last", "change", "ratio", "slope", "largest_rise"]
"""Values of a series: `change` is the last less the first, `ratio` the last over the first, `slope` that of the
line that fits best (per entry), `largest_rise` the largest step upwards from one entry to the next."""


def at(result: Any, path: str) -> Any:
    """Value at a path of names joined by points, None where there is nothing.

    In a list a number counts its entries (`logs.0`, `laps.-1`), and `*` means each of them
    (`laps.*.position_error_m.mean`): the result is a list then, with None where an entry has nothing there.
    """
    head, _, rest = path.partition(".")
    if isinstance(result, Mapping):
        found = result.get(head)
    elif not isinstance(result, list | tuple):
        return None
    elif head == "*":
        return [at(entry, rest) if rest else entry for entry in result]
    else:
        place = int(head) if head.lstrip("-").isdigit() else len(result)
        found = result[place] if -len(result) <= place < len(result) else None
    return at(found, rest) if rest else found


def series_at(result: Any, path: str) -> list[float | None]:
    """The series at a path; empty where there is none. What is no number is None."""
    found = at(result, path)
    return [float(each) if _is_number(each) else None for each in found] if isinstance(found, list | tuple) else []


def value_at(
    result: Any, path: str, aggregate: Aggregate = "mean", window: tuple[float, float] = (0.0, 1.0)
) -> float | None:
    """The number at a path, or the aggregate of the series there; several paths joined by + are added.

    `window` is the share of a series that counts, from its start: (0.75, 1) is its last quarter. None where there is
    nothing.
    """
    values = []
    for each in path.split("+"):
        found = at(result, each.strip())
        if isinstance(found, list | tuple):
            found = aggregated([float(value) if _is_number(value) else None for value in found], aggregate, window)
        if not _is_number(found):
            return None
        values.append(float(found))
    return sum(values)


def aggregated(
    series: Sequence[float | None], aggregate: Aggregate, window: tuple[float, float] = (0.0, 1.0)
) -> float | None:
    """One value of a series. Entries that are None are left out; None where too few are there."""
    starts, ends = (round(share * len(series), 9) for share in window)  # 0.07 of 100 is above 7 by rounding
    first, last = int(np.floor(starts)), int(np.ceil(ends))
    places = [place for place in range(first, last) if series[place] is not None]
    values = np.array([series[place] for place in places], dtype=np.float64)
    needed = 2 if aggregate in ("change", "ratio", "slope", "largest_rise") else 1
    if len(values) < needed or (aggregate == "ratio" and values[0] == 0.0):
        return None
    match aggregate:
        case "first":
            return float(values[0])
        case "last":
            return float(values[-1])
        case "change":
            return float(values[-1] - values[0])
        case "ratio":
            return float(values[-1] / values[0])
        case "slope":
            return float(np.polyfit(places, values, 1)[0])
        case "largest_rise":
            return float(np.diff(values).max())
        case _:
            return float(getattr(np, aggregate)(values))


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and bool(np.isfinite(value))

"""Metrics as people read them: names and units from the entries' names, numbers with as many digits as they carry."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Literal

STATISTICS = ("mean", "std", "median", "p90", "p95", "max", "rmse")
BAD_SHARES = ("loss_rate", "lost_rate", "new_after_first_lap_rate")
"""Shares of which less is better; of others, more."""
FIRST = ("position_error_m", "heading_error_deg", "loss_rate", "converged_after_frames", "frames")
"""Quantities that every run may have, in the order in which they are shown; others follow by name."""

_UNITS = {
    "_bytes": "kB",
    "_deg": "°",
    "_rate": "%",
    "_ms": "ms",
    "_px": "px",
    "_frames": "frames",
    "_m": "m",
    "_s": "s",
}


@dataclass(frozen=True)
class Leaf:
    """One entry of metrics.json: its place (`after_convergence`, …), name, and a number, text, None or statistics."""

    place: tuple[str, ...]
    name: str
    value: Any

    @property
    def statistics(self) -> dict[str, float] | None:
        """Mean, median and so on, where the entry is a distribution."""
        return self.value if isinstance(self.value, dict) else None


@dataclass(frozen=True)
class Measure:
    """A single number of metrics.json by its full path; of a distribution each statistic is one."""

    path: str
    name: str
    unit: str
    value: float | int | str | None

    @property
    def text(self) -> str:
        """The number as shown, without its unit."""
        return shown(self.path, self.value)

    @property
    def head(self) -> str:
        """Name and unit: the head of a row or column."""
        return f"{self.name} ({self.unit})" if self.unit else self.name

    @property
    def better(self) -> Literal["lower", "higher"] | None:
        """Which numbers are better ones: small errors, losses, sizes and times, large shares of what went well."""
        parts = self.path.split(".")
        last = parts[-2] if parts[-1] in STATISTICS else parts[-1]
        if last.endswith("_rate") and last not in BAD_SHARES:
            return "higher"
        return "lower" if "error" in last or last.endswith(("_rate", "_bytes", "_ms", "after_frames")) else None


def leaves(metrics: Mapping[str, Any], place: tuple[str, ...] = ()) -> Iterator[Leaf]:
    """All entries but those of single logs, the ones that lie less deep first."""
    deeper = []
    for name in sorted(metrics, key=lambda name: (FIRST.index(name) if name in FIRST else len(FIRST), name)):
        value = metrics[name]
        if isinstance(value, Mapping):
            if value and all(key in STATISTICS for key in value):
                yield Leaf(place, name, {key: value[key] for key in STATISTICS if key in value})
            else:
                deeper.append((name, value))
        elif not isinstance(value, list | tuple):
            yield Leaf(place, name, value)
    for name, value in deeper:
        yield from leaves(value, (*place, name))


def measures(metrics: Mapping[str, Any]) -> list[Measure]:
    """Every single number, flat."""
    flat = []
    for leaf in leaves(metrics):
        path = ".".join((*leaf.place, leaf.name))
        where = ", ".join(words(part) for part in leaf.place)
        entries = leaf.statistics or {"": leaf.value}
        for statistic, value in entries.items():
            name = ", ".join(part for part in (title(leaf.name), statistic, where) if part)
            flat.append(Measure(f"{path}.{statistic}" if statistic else path, name, unit(leaf.name), value))
    return flat


def unit(name: str) -> str:
    """The unit that the end of a name stands for, '' where there is none."""
    return next((shown_as for end, shown_as in _UNITS.items() if name.endswith(end)), "")


def title(name: str) -> str:
    """`position_error_m` -> `Position error`."""
    text = words(next((name.removesuffix(end) for end in _UNITS if name.endswith(end) and end != "_rate"), name))
    return text[:1].upper() + text[1:]


def words(name: str) -> str:
    """`after_convergence` -> `after convergence`."""
    return name.replace("_", " ")


def shown(name: str, value: Any) -> str:
    """A value as text, in the unit that `unit` says; `name` may be a path with a statistic at its end."""
    parts = name.split(".")
    last = parts[-2] if parts[-1] in STATISTICS and len(parts) > 1 else parts[-1]
    if value is None:
        return "never" if last == "converged_after_frames" else "–"
    if isinstance(value, bool | str) or not isinstance(value, int | float):
        return str(value)
    if last.endswith("_rate"):
        return digits(100 * value)
    if last.endswith("_bytes"):
        return digits(value / 1000)
    return digits(value)


def digits(number: float) -> str:
    """Three significant digits or so, never scientific notation for what people measure: 0.073, 1.52, 12.4, 3500."""
    if isinstance(number, int) or number == 0:
        return f"{number:.0f}" if abs(number) < 10_000 else f"{number:,.0f}".replace(",", "\u2009")
    size = abs(number)
    places = 0 if size >= 100 else 1 if size >= 10 else 2 if size >= 1 else 3
    return f"{number:.{places}f}" if size >= 0.0005 else f"{number:.1e}"

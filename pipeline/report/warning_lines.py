"""What whoever reads a run's results should know first: what its stages warn of, and what was skipped."""

from collections.abc import Mapping
from typing import Any

from .quantities import words


def skipped(manifest: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Of each kind of data that was skipped: `kind`, `count`, and the `first` case as text."""
    found = manifest.get("dropped") or {}
    return [
        {"kind": words(kind), "count": entry["count"], "first": entry.get("first", "")}
        if isinstance(entry, Mapping)
        else {"kind": words(kind), "count": entry, "first": ""}
        for kind, entry in found.items()
    ]


def warning_lines(manifest: Mapping[str, Any]) -> list[str]:
    """A line for each warning, and one for each kind of skipped data with its first case. Mere counts are none."""
    lines = [str(warning) for warning in manifest.get("warnings") or ()]
    for row in skipped(manifest):
        if row["first"]:
            kind, which = row["kind"].rpartition(".")[2], "" if row["count"] == 1 else "first: "
            lines.append(f"{kind}: {row['count']} ({which}{row['first']})")
    return lines

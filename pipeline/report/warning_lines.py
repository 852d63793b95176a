"""Warnings of a run: what its stages warn of, and what data was skipped."""

import re
from collections.abc import Mapping, Sequence
from typing import Any

from omninav.pipeline.graph.problems import counted

from .metrics import humanise

PARTICULARS = re.compile(r"^(?:\w+: )+|\S*[\d/]\S*|\S+\.\w+\S*")
"""Parts of a sentence that tell where something was found: the names in front, numbers, files."""


def skipped(manifest: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Kinds of data that were skipped: `kind`, `count`, and the `first` case as text."""
    return [{"kind": humanise(kind), **entry} for kind, entry in (manifest.get("dropped") or {}).items()]


def warning_lines(manifest: Mapping[str, Any]) -> list[str]:
    """A line for each warning, and one for each kind of skipped data with its first case. Mere counts are none."""
    lines = [str(warning) for warning in manifest.get("warnings") or ()]
    for row in skipped(manifest):
        if row["first"]:
            kind, which = row["kind"].rpartition(".")[2], "" if row["count"] == 1 else "first: "
            times = "" if row["count"] == 1 else f", {counted(row['count'], 'time')}"
            lines.append(f"{kind}{times} ({which}{row['first']})")
    return lines


def grouped(lines: Sequence[str]) -> list[str]:
    """One line for warnings that differ in files, places or numbers alone: the first, and how many there are."""
    found: dict[str, list[str]] = {}
    for line in lines:
        found.setdefault(" ".join(PARTICULARS.sub("", line).split()), []).append(line)
    return [one if not more else f"{one} (and {len(more)} more like this)" for one, *more in found.values()]

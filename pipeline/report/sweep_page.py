"""A sweep as one page: means of each condition, and a row per job."""

import os
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from omninav.pipeline.files import write_whole
from omninav.pipeline.graph.problems import counted

from .metrics import best_of, metric_values
from .rendering import render
from .sweep_table import overview_of, settings_of, write_sweep_tables


def write_sweep_page(folder: Path, rows: Sequence[Mapping[str, Any]]) -> Path:
    """Write `sweep.html`: a line per job with what it changed, how it ended, its headlines or its error, and means.

    Beside it are the same numbers as tables (see `write_sweep_tables`).

    A row holds `job`, `folder` (the job's run folder), `manifest` (with `overrides`, `status`, `error`) and `metrics`
    (`Metrics`, None where the job has none).
    """
    seen = overview_of(rows)
    measured = [{} if row["metrics"] is None else metric_values(row["metrics"]) for row in rows]
    best = {path: best_of(path, measured) for path in seen.paths}
    names = [*seen.settings, *(["seed"] if seen.seeds else [])]
    lines = []
    for number, (row, run) in enumerate(zip(rows, measured, strict=True)):
        manifest, own = row["manifest"], Path(row["folder"])
        cells = [{"text": run[path].text if path in run else "", "best": number in best[path]} for path in seen.paths]
        settings = settings_of(manifest)
        lines.append(
            {
                "job": row["job"],
                "settings": [settings.get(name, "") for name in names],
                "status": manifest.get("status", ""),
                "error": manifest.get("error", ""),
                "cells": cells,
                "report": _link(folder, own / "report.html"),
                "log": _link(folder, own / "run.log"),
            }
        )
    counts = Counter(str(line["status"]) for line in lines)
    page = render(
        "sweep.html",
        title=folder.resolve().name,
        counts=f"{counted(len(lines), 'job')}: "
        + ", ".join(f"{number} {status}" for status, number in sorted(counts.items())),
        sweep=seen,
        names=names,
        rows=lines,
        repeated=any(condition.jobs > 1 for condition in seen.conditions),
    )
    path = folder / "sweep.html"
    write_whole(path, page)
    write_sweep_tables(folder, rows)
    return path


def _link(folder: Path, file: Path) -> str:
    return Path(os.path.relpath(file, folder)).as_posix() if file.exists() else ""

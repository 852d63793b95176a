"""A sweep as one page: a row per job."""

import math
import os
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from omninav.pipeline.files import write_whole

from .quantities import Number, best_of, head_of, headlines, numbers
from .rendering import render
from .sweep_table import Mean, conditions, write_sweep_tables


def write_sweep_page(folder: Path, rows: Sequence[Mapping[str, Any]]) -> Path:
    """Write `sweep.html`: a line per job with what it changed, how it ended, its main figures or its error, and means.

    Beside it lie the same numbers as tables (see `write_sweep_tables`).

    A row holds `job`, `folder` (the job's run folder), `manifest` (with `overrides`, `status`, `error`) and `metrics`
    (`Metrics`, None where the job has none).
    """
    runs = [row["metrics"] for row in rows]
    measured = [{} if metrics is None else numbers(metrics) for metrics in runs]
    every = [p for p in headlines([each for each in runs if each is not None]) if any(p in run for run in measured)]
    ended = [run for run in measured if run]
    alike = [p for p in every if len(ended) > 1 and len({run[p].text if p in run else "" for run in ended}) == 1]
    paths = [path for path in every if path not in alike]
    best = {path: best_of(path, measured) for path in paths}
    lines = []
    for number, (row, run) in enumerate(zip(rows, measured, strict=True)):
        manifest, own = row["manifest"], Path(row["folder"])
        cells = [{"text": run[path].text if path in run else "", "best": number in best[path]} for path in paths]
        lines.append(
            {
                "job": row["job"],
                "overrides": manifest.get("overrides", ""),
                "status": manifest.get("status", ""),
                "error": manifest.get("error", ""),
                "cells": cells,
                "report": _link(folder, own / "report.html"),
                "log": _link(folder, own / "run.log"),
            }
        )
    means: list[dict[str, Any]] = []
    for condition in conditions(rows):
        figures = [condition.means.get(path) for path in paths]
        shown = [
            "" if mean is None else _shown(mean, path, measured) for path, mean in zip(paths, figures, strict=True)
        ]
        settings = " ".join(f"{name}={value}" for name, value in condition.settings.items())
        means.append({"settings": settings or "the defaults", "jobs": condition.jobs, "cells": shown})
    counts = Counter(str(line["status"]) for line in lines)
    page = render(
        "sweep.html",
        title=folder.resolve().name,
        counts=f"{len(lines)} jobs: " + ", ".join(f"{number} {status}" for status, number in sorted(counts.items())),
        columns=[head_of(path, measured) for path in paths],
        alike=[f"{head_of(path, measured)} {ended[0][path].text}" for path in alike],
        rows=lines,
        means=means if any(condition["jobs"] > 1 for condition in means) else [],
    )
    path = folder / "sweep.html"
    write_whole(path, page)
    write_sweep_tables(folder, rows)
    return path


def _shown(mean: Mean, path: str, runs: Sequence[Mapping[str, Number]]) -> str:
    entry = next(run[path] for run in runs if path in run).entry
    if mean.low is None or mean.high is None:
        return entry.text(mean.mean)
    low, high = mean.mean - mean.low, mean.high - mean.mean
    if math.isclose(low, high, rel_tol=1e-9, abs_tol=1e-12):
        return f"{entry.text(mean.mean)} ± {entry.text(high)}"
    return f"{entry.text(mean.mean)} ({entry.text(mean.low)} to {entry.text(mean.high)})"


def _link(folder: Path, file: Path) -> str:
    return Path(os.path.relpath(file, folder)).as_posix() if file.exists() else ""

"""A run, or a sweep, as one self-contained page; results and comparisons as tables for the terminal."""

import base64
import os
import shlex
from collections import Counter
from collections.abc import Mapping, Sequence
from importlib.resources import files
from pathlib import Path
from string import ascii_uppercase
from typing import TYPE_CHECKING, Any

from omninav.pipeline.files import write_whole
from omninav.pipeline.graph.results import Figure, Table

from .quantities import (
    FIRST,
    STATISTICS,
    Leaf,
    Measure,
    digits,
    leaves,
    measures,
    shown,
    title,
    unit,
    words,
)

if TYPE_CHECKING:
    from rich.table import Table as TerminalTable

LIFETIMES = {"before": "before the loop", "tick": "every tick", "after": "after it"}
SWEEP_COLUMNS = (
    "after_convergence.position_error_m.median",
    "after_convergence.position_error_m.p90",
    "after_convergence.heading_error_deg.median",
    "loss_rate",
    "converged_after_frames",
)
HEADLINES = (
    "navigation.state",
    "navigation.end_error_m",
    "navigation.time_s",
    "homing.arrived",
    "homing.end_error_m",
    "homing.time_s",
    "localisation.right_rate",
    "localisation.near_rate",
    "map.places",
    "loops.far_in_drive.precision",
    "loops.far_in_drive.recall",
)
"""What one looks for first where a run has it."""
WIDEST_NAME = 24
"""Of a run at the head of a column, in characters."""
BESIDE = ("mean_pose.", "odometry_alone.after_convergence.")
"""What a comparison leaves out, because it says little about which run is better."""
UNMEASURED = ("frames", "map", "logs")
"""What every run states, whether or not anything was measured in it."""
Rows = list[dict[str, Any]]


# one run


def write_report(
    folder: Path,
    manifest: Mapping[str, Any],
    metrics: Mapping[str, Any],
    timing: Mapping[str, Any],
    graph_svg: str,
    figures: Sequence[Figure],
    tables: Sequence[Table],
    config_yaml: str,
) -> Path:
    """Write `report.html` into a run's folder: results, what was left out, pictures, graph, times, how to run it again.

    Nothing on the page is fetched from anywhere. Figures and tables stand in their order.
    """
    from markupsafe import Markup

    inlined = [
        {
            "name": figure.name,
            "title": figure.title,
            "caption": figure.caption,
            "media_type": figure.media_type,
            "base64": base64.b64encode(figure.content).decode(),
            "per_second": figure.per_second if figure.media_type.startswith("video/") else None,
        }
        for figure in sorted(figures, key=lambda figure: (figure.order, figure.name))
    ]
    shown_tables = [
        {"title": t.title, "caption": t.caption, "columns": t.columns, "rows": [[_cell(c) for c in r] for r in t.rows]}
        for t in sorted(tables, key=lambda table: (table.order, table.name))
    ]
    page = render(
        "report.html",
        title=folder.resolve().name,
        manifest=manifest,
        tiles=_tiles(metrics, timing),
        results=_results(metrics),
        logs=_log_table(metrics),
        facts=[(words(str(k)), _cell(v)) for k, v in (manifest.get("facts") or {}).items()],
        dropped=_dropped(manifest),
        figures=inlined,
        tables=shown_tables,
        graph_svg=Markup(graph_svg[graph_svg.find("<svg") :]),  # our own drawing, escaped where it was drawn
        timing=_timing(timing),
        again=shlex.join(map(str, manifest.get("argv") or ["omninav"])),
        resume=f"omninav resume {shlex.quote(_seen_from(folder, manifest.get('cwd')))}",
        provenance=_provenance(manifest),
        config_yaml=config_yaml,
    )
    path = folder / "report.html"
    write_whole(path, page)
    return path


def _results(metrics: Mapping[str, Any]) -> dict[str, Any]:
    """Quantities that are measured in several ways, each with a row per way, and single figures apart."""
    ways: dict[str, list[Leaf]] = {}
    for leaf in leaves(metrics):
        ways.setdefault(leaf.name, []).append(leaf)
    columns = [s for s in STATISTICS if any(leaf.statistics and s in leaf.statistics for leaf in leaves(metrics))]
    quantities, single = [], []
    for name, found in ways.items():
        if not any(leaf.statistics for leaf in found) and (len(found) == 1 or name not in FIRST):
            single += [_single(leaf) for leaf in found]
            continue
        rows = []
        for leaf in found:
            numbers = leaf.statistics or ({"mean": leaf.value} if "mean" in columns else {columns[0]: leaf.value})
            cells = [shown(name, numbers[s]) if s in numbers else "" for s in columns]
            condition = ", ".join(words(part) for part in leaf.place) or "all frames"
            rows.append({"condition": condition, "cells": cells, "plain": not leaf.place})
        quantities.append({"name": title(name), "unit": unit(name), "rows": rows})
    measured = any(path.partition(".")[0] not in UNMEASURED for path in _by_path(metrics))
    return {"columns": columns, "quantities": quantities, "figures": single, "measured": measured}


def _single(leaf: Leaf) -> dict[str, str]:
    where = ", ".join(words(part) for part in leaf.place)
    name = f"{where[:1].upper()}{where[1:]}: {words(title(leaf.name).lower())}" if where else title(leaf.name)
    return {"name": name, "value": shown(leaf.name, leaf.value), "unit": "" if leaf.value is None else unit(leaf.name)}


def _tiles(metrics: Mapping[str, Any], timing: Mapping[str, Any]) -> Rows:
    """The handful of figures that one looks for first; errors after convergence where there was one."""
    known = _by_path(metrics)
    after = any(path.startswith("after_convergence.") for path in known)
    prefix = "after_convergence." if after else ""
    wanted = [f"{prefix}position_error_m.median", f"{prefix}position_error_m.p90", f"{prefix}heading_error_deg.median"]
    tiles = [
        {"name": known[path].name, "value": known[path].text, "unit": known[path].unit}
        for path in [*HEADLINES, *wanted, "loss_rate", "converged_after_frames"]
        if path in known
    ]
    for tile in tiles:
        tile["unit"] = "" if tile["value"] == "never" else tile["unit"]
    if timing.get("ticks_per_second"):
        tiles.append({"name": "Frames per second", "value": digits(float(timing["ticks_per_second"])), "unit": ""})
    return tiles


def _log_table(metrics: Mapping[str, Any]) -> dict[str, Any] | None:
    logs = metrics.get("logs")
    if not isinstance(logs, list | tuple) or not logs:
        return None
    per_log = [_by_path(log) for log in logs]
    paths = [path for path in ("frames", *SWEEP_COLUMNS) if any(path in log for log in per_log)]
    heads = ["log", *(_head(path, per_log) for path in paths)]
    rows = [[str(n), *(log[p].text if p in log else "–" for p in paths)] for n, log in enumerate(per_log)]
    return {"columns": heads, "rows": rows}


def _by_path(metrics: Mapping[str, Any]) -> dict[str, Measure]:
    return {measure.path: measure for measure in measures(metrics)}


def _head(path: str, runs: Sequence[Mapping[str, Measure]]) -> str:
    return next(run[path] for run in runs if path in run).head


def _dropped(manifest: Mapping[str, Any]) -> Rows:
    found = manifest.get("dropped") or {}
    return [
        {"kind": words(kind), "count": entry["count"], "first": entry.get("first", "")}
        if isinstance(entry, Mapping)
        else {"kind": words(kind), "count": entry, "first": ""}
        for kind, entry in found.items()
    ]


def _timing(timing: Mapping[str, Any]) -> dict[str, Any]:
    rows = [
        {
            "name": name,
            "lifetime": LIFETIMES.get(entry.get("lifetime", ""), ""),
            "calls": entry.get("calls", ""),
            **{key: digits(float(entry[f"{key}_ms"])) for key in ("p50", "p95", "max")},
        }
        for name, entry in (timing.get("stages") or {}).items()
    ]
    rate = timing.get("ticks_per_second")
    ticks = timing.get("ticks")
    return {"rows": rows, "ticks": ticks, "ticks_per_second": rate, "per_second": digits(float(rate)) if rate else ""}


def _provenance(manifest: Mapping[str, Any]) -> list[tuple[str, str]]:
    rows: list[tuple[str, Any]] = [
        ("omninav", manifest.get("omninav")),
        ("git commit", manifest.get("git_commit")),
        ("graph (hash)", manifest.get("graph")),
    ]
    rows += [(f"input {name} (sha256)", digest) for name, digest in (manifest.get("inputs") or {}).items()]
    for name, artifact in (manifest.get("artifacts") or {}).items():
        origin = artifact.get("file") or f"variant {artifact.get('variant')}, {artifact.get('from')}"
        rows.append((f"{name}", f"{origin} ({artifact.get('said', '')}; sha256 {artifact.get('sha256', '')})"))
    for name, file in (manifest.get("saved") or {}).items():
        rows.append((f"saved {name}", f"{file['file']}, {digits(file['bytes'] / 1000)} kB, sha256 {file['sha256']}"))
    rows += [("cached front", manifest.get("front")), ("Python", manifest.get("python"))]
    rows.append(("libraries", ", ".join(f"{k} {v}" for k, v in (manifest.get("libraries") or {}).items())))
    return [(name, str(value)) for name, value in rows if value]


def _seen_from(folder: Path, cwd: Any) -> str:
    """A folder as one types it in `cwd`: relative where it lies below it."""
    try:
        return str(folder.resolve().relative_to(Path(str(cwd)).resolve()))
    except ValueError:
        return str(folder.resolve())


def _cell(value: Any) -> str:
    if isinstance(value, float):
        return digits(value)
    return "" if value is None else str(value)


def render(template: str, **values: Any) -> str:
    """A page from a template of ours; text is escaped in HTML and stays as it is elsewhere."""
    from jinja2 import Environment, FunctionLoader
    from markupsafe import Markup

    folder = files(__package__).joinpath("templates")
    loader = FunctionLoader(lambda name: folder.joinpath(name).read_text(encoding="utf-8"))
    environment = Environment(
        loader=loader, autoescape=template.endswith(".html"), trim_blocks=True, lstrip_blocks=True
    )
    css = Markup(folder.joinpath("page.css").read_text(encoding="utf-8"))
    return environment.get_template(template).render(css=css, **values)


# a sweep


def write_sweep_page(folder: Path, rows: Sequence[Mapping[str, Any]]) -> Path:
    """Write `sweep.html`: a line per job with what it changed, how it ended, its main figures or its error.

    A row holds `job`, `folder` (the job's run folder), `manifest` (with `overrides`, `status`, `error`) and `metrics`.
    """
    measured = [_by_path(row.get("metrics") or {}) for row in rows]
    paths = [path for path in SWEEP_COLUMNS if any(path in run for run in measured)]
    best = {path: _best(path, measured) for path in paths}
    lines = []
    for number, (row, run) in enumerate(zip(rows, measured, strict=True)):
        manifest, own = row["manifest"], Path(row["folder"])
        cells = [
            {"text": run[path].text if path in run else "", "best": number in best[path] and len(rows) > 1}
            for path in paths
        ]
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
    counts = Counter(str(line["status"]) for line in lines)
    page = render(
        "sweep.html",
        title=folder.resolve().name,
        counts=f"{len(lines)} jobs: " + ", ".join(f"{number} {status}" for status, number in sorted(counts.items())),
        columns=[_head(path, measured) for path in paths],
        rows=lines,
    )
    path = folder / "sweep.html"
    write_whole(path, page)
    return path


def _link(folder: Path, file: Path) -> str:
    return Path(os.path.relpath(file, folder)).as_posix() if file.exists() else ""


def _best(path: str, runs: Sequence[Mapping[str, Measure]]) -> set[int]:
    """Which runs have the best number, where it is known which is; none where all have the same."""
    better = next((run[path].better for run in runs if path in run), None)
    numbers = {n: run[path].value for n, run in enumerate(runs) if path in run and better}
    known = {n: float(value) for n, value in numbers.items() if isinstance(value, int | float)}
    if len(set(known.values())) < 2:
        return set()
    best = min(known.values()) if better == "lower" else max(known.values())
    return {number for number, value in known.items() if value == best}


# tables for the terminal


def results_table(metrics: Mapping[str, Any]) -> "TerminalTable":
    """A run's figures with units, the estimate beside odometry alone."""
    from rich.table import Table as TerminalTable

    results = _results({name: value for name, value in metrics.items() if name != "mean_pose"})
    table = TerminalTable(title="Results", title_justify="left", header_style="bold")
    table.add_column("")
    for column in results["columns"] or [""]:
        table.add_column(column, justify="right")
    for quantity in results["quantities"]:
        name = f"{quantity['name']} ({quantity['unit']})" if quantity["unit"] else quantity["name"]
        table.add_row(f"[bold]{name}[/bold]")
        for row in quantity["rows"]:
            style = "bold cyan" if row["plain"] else ""
            table.add_row(f"  {row['condition']}", *row["cells"], style=style)
        table.add_section()
    for row in results["figures"]:
        table.add_row(row["name"], f"{row['value']} {row['unit']}".strip())
    return table


def compare_table(runs: Sequence[Mapping[str, Any]]) -> "TerminalTable":
    """Several runs' figures side by side, the best of each marked with *, and the settings in which they differ.

    A run holds `name`, `metrics`, `config` and `manifest`.
    """
    from rich.table import Table as TerminalTable

    heads, below = [str(run["name"]) for run in runs], ["* the best of its line"]
    if max(map(len, heads)) > WIDEST_NAME:  # folded names are hard to tell apart: letters, and what they stand for
        letters = [ascii_uppercase[n % 26] * (n // 26 + 1) for n in range(len(runs))]
        below = [*(f"{letter}: {name}" for letter, name in zip(letters, heads, strict=True)), *below]
        heads = letters
    table = TerminalTable(
        title="Comparison",
        title_justify="left",
        header_style="bold",
        caption="\n".join(below),
        caption_justify="left",
    )
    table.add_column("")
    for head in heads:
        table.add_column(head, justify="right", overflow="fold")
    table.add_row("variant", *(str(run["manifest"].get("variant", "")) for run in runs))
    table.add_row("status", *(str(run["manifest"].get("status", "")) for run in runs))
    table.add_section()
    measured = [_by_path(run["metrics"]) for run in runs]
    paths = [p for p in dict.fromkeys(path for run in measured for path in run) if not p.startswith(BESIDE)]
    for path in paths:
        best = _best(path, measured)
        cells = [run[path].text if path in run else "–" for run in measured]
        marked = [f"[bold green]{cell} *[/]" if n in best else f"{cell}  " for n, cell in enumerate(cells)]
        table.add_row(_head(path, measured), *marked)
    table.add_section()
    for setting, values in differing_settings([run["config"] for run in runs]):
        table.add_row(f"[dim]{setting}[/]", *values)
    return table


def differing_settings(configs: Sequence[Mapping[str, Any]]) -> list[tuple[str, list[str]]]:
    """Dotted names of settings that are not the same in all configurations, with each one's value ('–': not there)."""
    flat = [dict(_flat(config)) for config in configs]
    names = dict.fromkeys(name for settings in flat for name in settings)
    found = [(name, [str(settings.get(name, "–")) for settings in flat]) for name in names]
    return [(name, values) for name, values in found if len(set(values)) > 1]


def _flat(config: Mapping[str, Any], prefix: str = "") -> list[tuple[str, Any]]:
    flat: list[tuple[str, Any]] = []
    for key, value in config.items():
        if isinstance(value, Mapping) and value:
            flat += _flat(value, f"{prefix}{key}.")
        else:
            flat.append((f"{prefix}{key}", value))
    return flat

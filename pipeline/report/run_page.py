"""A run as one self-contained page."""

import base64
import shlex
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from omninav.pipeline.files import write_whole
from omninav.pipeline.graph.results import Figure, Metrics, Table

from .quantities import digits, head_of, headlines, numbers, per_log, words
from .rendering import render
from .results import results

LIFETIMES = {"before": "before the loop", "tick": "every tick", "after": "after the loop"}
Rows = list[dict[str, Any]]


def write_report(
    folder: Path,
    manifest: Mapping[str, Any],
    metrics: Metrics,
    timing: Mapping[str, Any],
    graph_svg: str,
    figures: Sequence[Figure],
    tables: Sequence[Table],
    config_yaml: str,
) -> Path:
    """Write `report.html` into a run's folder: results, skipped data, plots, graph, times, how to run it again.

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
        results=results(metrics),
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


def _tiles(metrics: Metrics, timing: Mapping[str, Any]) -> Rows:
    """What one looks for first."""
    known = numbers(metrics)
    tiles = [
        {"name": found.name, "value": found.text, "unit": "" if found.value is None else found.unit}
        for found in (known[path] for path in headlines([metrics]) if path in known)
    ]
    if timing.get("ticks_per_second"):
        tiles.append({"name": "Frames per second", "value": digits(float(timing["ticks_per_second"])), "unit": ""})
    return tiles


def _log_table(metrics: Metrics) -> dict[str, Any] | None:
    logs = per_log(metrics)
    if not logs:
        return None
    paths = [path for path in ("frames", *headlines([metrics])) if any(path in log for log in logs)]
    heads = ["log", *(head_of(path, logs) for path in paths)]
    rows = [[str(n), *(log[path].text if path in log else "–" for path in paths)] for n, log in enumerate(logs)]
    return {"columns": heads, "rows": rows}


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
        origin = artifact.get("file") or f"variant {artifact.get('variant')}, {artifact.get('output')}"
        rows.append((f"{name}", f"{origin} ({artifact.get('reason', '')}; sha256 {artifact.get('sha256', '')})"))
    for name, file in (manifest.get("saved") or {}).items():
        rows.append((f"saved {name}", f"{file['file']}, {digits(file['bytes'] / 1000)} kB, sha256 {file['sha256']}"))
    rows += [("cached prefix", manifest.get("prefix")), ("Python", manifest.get("python"))]
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

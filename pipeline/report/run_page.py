"""A run as one self-contained page."""

import base64
import dataclasses
import json
import shlex
from collections.abc import Mapping, Sequence
from itertools import zip_longest
from pathlib import Path
from typing import Any

from omninav.pipeline.files import write_whole
from omninav.pipeline.graph.graph import Graph
from omninav.pipeline.graph.results import Metrics, Plot, Slide, Table

from .chart import BEGINNING
from .headlines import headline_rows
from .metrics import digits, head_of, headline_paths, per_log, title, unit
from .metrics_table import metrics_table
from .rendering import render
from .warning_lines import skipped, warning_lines

LIFETIMES = {"before": "before the loop", "tick": "every tick", "after": "after the loop"}


def write_report(
    folder: Path,
    manifest: Mapping[str, Any],
    metrics: Metrics,
    timing: Mapping[str, Any],
    graph_svg: str,
    plots: Sequence[Plot],
    tables: Sequence[Table],
    config_yaml: str,
    graph: Graph | None = None,
    shown_as: Path | None = None,
) -> Path:
    """Write `report.html` into a run's folder: warnings, headlines and plots, then all else, folded.

    Nothing on the page is fetched from anywhere. Plots and tables are in their order. The parameters are those of
    `graph`. The page names the folder `shown_as`, where that is another one.
    """
    from markupsafe import Markup

    shown_plots = [_shown(plot) for plot in sorted(plots, key=lambda plot: (plot.order, plot.name))]
    _stand_side_by_side(shown_plots)
    shown_tables = [
        {"title": t.title, "caption": t.caption, "columns": t.columns, "rows": [[_cell(c) for c in r] for r in t.rows]}
        for t in sorted(tables, key=lambda table: (table.order, table.name))
    ]
    page = render(
        "report.html",
        title=(shown_as or folder).resolve().name,
        manifest=manifest,
        tiles=headline_rows(metrics, timing),
        results=metrics_table(metrics),
        logs=_log_table(metrics),
        warnings=warning_lines(manifest),
        facts=[_fact(str(name), value) for name, value in (manifest.get("facts") or {}).items()],
        dropped=skipped(manifest),
        plots=shown_plots,
        tables=shown_tables,
        graph_svg=Markup(graph_svg[graph_svg.find("<svg") :]),  # our own drawing, escaped where it was drawn
        parameters=[] if graph is None else parameter_rows(graph),
        timing=_timing(timing),
        again=shlex.join(map(str, manifest.get("argv") or ["omninav"])),
        resume=f"omninav resume {shlex.quote(_seen_from(shown_as or folder, manifest.get('cwd')))}",
        provenance=_provenance(manifest),
        config_yaml=config_yaml,
    )
    path = folder / "report.html"
    write_whole(path, page)
    return path


def _shown(plot: Plot) -> dict[str, Any]:
    """A plot as the page shows it: a chart of ours is embedded as it is, everything else as a picture."""
    from markupsafe import Markup

    shown: dict[str, Any] = {"name": plot.name, "title": plot.title, "caption": plot.caption, "kind": "picture"}
    if plot.content.startswith(BEGINNING.encode()):
        drawn = plot.content.decode().replace(' xmlns="http://www.w3.org/2000/svg"', "", 1)
        shown |= {"kind": "chart", "svg": Markup(drawn)}
        if plot.slides:
            shown |= {"kind": "slides", "slides": plot.slides, "data": Markup(_slides(plot.slides))}
        return shown
    return shown | {"media_type": plot.media_type, "base64": base64.b64encode(plot.content).decode()}


def _stand_side_by_side(plots: Sequence[dict[str, Any]]) -> None:
    """Put charts that follow each other in pairs; one that is left over is beside its caption."""
    charts = 0
    for plot, following in zip_longest(plots, plots[1:]):
        charts = charts + 1 if plot["kind"] == "chart" else 0
        ends = following is None or following["kind"] != "chart"
        plot["place"] = "" if not charts else "alone" if ends and charts % 2 else "half"


def _slides(slides: Sequence[Slide]) -> str:
    """JSON for the page's script; a picture that several slides show is in it once."""
    numbers: dict[bytes, int] = {}
    rows = [
        {
            "label": slide.label,
            "overlay": slide.overlay,
            "photographs": [(words, numbers.setdefault(jpeg, len(numbers))) for words, jpeg in slide.photographs],
            "facts": slide.facts,
        }
        for slide in slides
    ]
    photographs = [base64.b64encode(jpeg).decode() for jpeg in numbers]
    return json.dumps({"slides": rows, "photographs": photographs}).replace("<", "\\u003c")


def _fact(name: str, value: Any) -> tuple[str, str]:
    of = unit(name)
    return title(name), f"{_cell(value)} {of}" if of and isinstance(value, int | float) else _cell(value)


def _log_table(metrics: Metrics) -> dict[str, Any] | None:
    logs = per_log(metrics)
    if not logs:
        return None
    paths = [path for path in ("frames", *headline_paths([metrics])) if any(path in log for log in logs)]
    heads = ["log", *(head_of(path, logs) for path in paths)]
    rows = [[str(n), *(log[path].text if path in log else "–" for path in paths)] for n, log in enumerate(logs)]
    return {"columns": heads, "rows": rows}


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
    cached = timing.get("cached") or ()
    counted = "without the first frame" + (f" and without {', '.join(cached)}, read from the cache" if cached else "")
    per_second = digits(float(rate)) if rate else ""
    return {"rows": rows, "ticks": ticks, "ticks_per_second": rate, "per_second": per_second, "counted": counted}


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


def parameter_rows(graph: Graph) -> list[dict[str, Any]]:
    """All parameters in the order of the graph: value and default as texts, meaning, and whether they differ."""
    rows = []
    for node in graph.nodes.values():
        for name, parameter in node.signature.parameters.items():
            stated = parameter.default
            default = _plain({} if stated is dataclasses.MISSING else stated)
            value = _plain(node.parameters.get(name, default))
            if isinstance(default, dict) and isinstance(value, dict):
                value = default | value  # of settings that belong together, some may be left out
            shown = "" if stated is dataclasses.MISSING else _text(default)
            row = {"node": node.name, "name": name, "value": _text(value), "default": shown}
            rows.append({**row, "meaning": parameter.meaning, "changed": value != default})
    return rows


def _plain(value: object) -> object:
    """A value as a configuration has it."""
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return {field.name: _plain(getattr(value, field.name)) for field in dataclasses.fields(value)}
    return [_plain(each) for each in value] if isinstance(value, tuple | list) else value


def _text(value: object) -> str:
    text = str(value)
    return text if len(text) <= 120 else f"{text[:119]}…"


def _seen_from(folder: Path, cwd: Any) -> str:
    """A folder as one types it in `cwd`: relative where it is below it."""
    try:
        return str(folder.resolve().relative_to(Path(str(cwd)).resolve()))
    except ValueError:
        return str(folder.resolve())


def _cell(value: Any) -> str:
    if isinstance(value, float):
        return digits(value)
    return "" if value is None else str(value)

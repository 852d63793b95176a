"""Results of a graph that has run: metrics, plots, tables, counts and facts."""

from collections.abc import Container, Iterator
from typing import Any

from omninav.pipeline.engine.engine import Engine
from omninav.pipeline.graph.results import Metrics, Plot, Table, by_path, merged


def results_of(engine: Engine) -> tuple[Metrics, list[Plot], list[Table]]:
    """Metrics merged into one, plots and tables. A stage that changes another's metric is warned of."""
    metrics: list[Metrics] = []
    stated: dict[str, tuple[str, Any]] = {}
    plots: list[Plot] = []
    tables: list[Table] = []
    for node in engine.graph.nodes.values():
        for origin in node.origins:
            for value in _flat(engine.last(origin)):
                if isinstance(value, Metrics):
                    metrics.append(value)
                    for path, number in by_path(merged([value]).values):
                        other, before = stated.setdefault(path, (node.name, number))
                        if number != before:
                            what = f"{path} in metrics.json is its own, not that of {other}"
                            engine.calls[node.name].ctx.warn(f"{node.name}: {what}; give it another name")
                elif isinstance(value, Plot):
                    plots.append(value)
                elif isinstance(value, Table):
                    tables.append(value)
    return merged(metrics), plots, tables


def _flat(value: Any) -> Iterator[Any]:
    if isinstance(value, tuple | list):
        for item in value:
            yield from _flat(item)
    elif value is not None:
        yield value


def notes_of(engine: Engine, only: Container[str] | None = None) -> dict[str, Any]:
    """Counts, facts and warnings of the stages, or only of these, as the manifest holds them."""
    dropped: dict[str, Any] = {}
    facts: dict[str, Any] = {}
    warnings: list[str] = []
    for name, call in engine.calls.items():
        if only is not None and name not in only:
            continue
        for kind, number in call.ctx.counts.items():
            first = call.ctx.details.get(kind, "")
            dropped[kind if "." in kind else f"{name}.{kind}"] = {"count": number, "first": first}
        facts |= call.ctx.facts | call.ctx.run_facts
        warnings += call.ctx.warnings
    return {"dropped": dropped, "facts": facts, "warnings": warnings}

"""The metric that a job of a sweep returns to an optimiser."""

import ast
import inspect
import sys
from collections.abc import Iterator

from omninav.pipeline.graph.graph import Graph, Node
from omninav.pipeline.graph.problems import BadInput, nearest, suggest
from omninav.pipeline.graph.results import Metrics
from omninav.pipeline.report.metrics import metric_values

FRAMEWORK = __name__.partition(".pipeline.")[0] + ".pipeline."


def check_objective(path: str | None, graph: Graph) -> None:
    """Raise `BadInput` where no stage of the graph can give a metric of this name: before the run, not at its end.

    Stages name their metrics when they have run. Until then the first part of the path has to occur in the source of a
    stage that measures, or of a module that it takes something from; of a name that is put together, one piece has to.
    """
    if not path:
        return
    first = path.partition(".")[0]
    names: set[str] = set()
    for module in {name for node in graph.nodes.values() for name in _measuring_modules(node)}:
        try:
            source = inspect.getsource(sys.modules[module])
        except (OSError, TypeError):
            return  # a module without source may name any
        for text, is_piece in _texts(source):
            if text == first or (is_piece and len(text) > 1 and text in first):
                return
            names.add(text)
    near = nearest(first, sorted(name for name in names if name.isidentifier()))
    hint = f"did you mean '{near}'?" if near else "metrics.json of an earlier run has the names"
    raise BadInput(f"objective={path}: no stage of this graph measures '{first}'; {hint}")


def objective_of(metrics: Metrics, path: str) -> float | None:
    """The metric that an optimiser works on; None where it is no number. Raises `BadInput` where there is none."""
    found = metric_values(metrics)
    if path not in found:
        raise BadInput(f"objective={path}: this run has no such metric; {suggest(path, found, 'metrics')}")
    value = found[path].value
    return float(value) if isinstance(value, int | float) else None


def _measuring_modules(node: Node) -> Iterator[str]:
    """The modules in whose source a stage's metrics are named; none of a stage that measures nothing."""
    if not any(port.type is Metrics for port in node.signature.outputs.values()):
        return
    module = type(node.stage).__module__
    yield module
    package = module.partition(".")[0]
    for thing in vars(sys.modules[module]).values():
        origin = getattr(thing, "__module__", None) or ""
        if origin.partition(".")[0] == package and not origin.startswith(FRAMEWORK):
            yield origin


def _texts(source: str) -> Iterator[tuple[str, bool]]:
    """The texts of a module's source, each with whether it is a piece of one that is put together."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.JoinedStr):
            yield from ((str(part.value), True) for part in node.values if isinstance(part, ast.Constant))
        elif isinstance(node, ast.Constant) and isinstance(node.value, str):
            yield node.value, False

"""The framework: stages, graphs, runs and experiments. What they are about is in `omninav.stages`."""

from .graph.problems import BadInput, Problem, ProblemsFound
from .graph.results import Metrics, MetricSpec, MetricStage, Plot, PlotStage, Table
from .graph.stage import Bounds, Context, Outputs, Source, Stage, State, Truth
from .graph.stored_rows import StoredRows
from .graph.tool import Tool
from .graph.value import Tick, Value

__all__ = [
    "BadInput",
    "Bounds",
    "Context",
    "MetricSpec",
    "MetricStage",
    "Metrics",
    "Outputs",
    "Plot",
    "PlotStage",
    "Problem",
    "ProblemsFound",
    "Source",
    "Stage",
    "State",
    "StoredRows",
    "Table",
    "Tick",
    "Tool",
    "Truth",
    "Value",
]

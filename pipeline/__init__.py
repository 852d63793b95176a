"""The framework: stages, graphs, runs and experiments. What they are about is in `omninav.stages`."""

from .files import digest_file, digest_text, named, open_itself, user_path, write_whole
from .graph.contents import Covariances, RowsOf, Shape, Shares, Starts, UnitRows, wrong_output
from .graph.parameters import Parameter, read_parameters
from .graph.ports import convert, convert_fields
from .graph.problems import BadInput, Problem, ProblemsFound, counted, cut, nearest, shown
from .graph.registry import offered, refuse_untyped
from .graph.results import Metrics, MetricSpec, MetricStage, Plot, PlotStage, Slide, Table
from .graph.small_files import parse_yaml, read_small, read_yaml
from .graph.stage import Bounds, Context, Outputs, Source, Stage, State, Truth
from .graph.stored_rows import GatheredRows, StoredRows
from .graph.tool import Tool
from .graph.value import Tick, Value

__all__ = [
    "BadInput",
    "Bounds",
    "Context",
    "Covariances",
    "GatheredRows",
    "MetricSpec",
    "MetricStage",
    "Metrics",
    "Outputs",
    "Parameter",
    "Plot",
    "PlotStage",
    "Problem",
    "ProblemsFound",
    "RowsOf",
    "Shape",
    "Shares",
    "Slide",
    "Source",
    "Stage",
    "Starts",
    "State",
    "StoredRows",
    "Table",
    "Tick",
    "Tool",
    "Truth",
    "UnitRows",
    "Value",
    "convert",
    "convert_fields",
    "counted",
    "cut",
    "digest_file",
    "digest_text",
    "named",
    "nearest",
    "offered",
    "open_itself",
    "parse_yaml",
    "read_parameters",
    "read_small",
    "read_yaml",
    "refuse_untyped",
    "shown",
    "user_path",
    "write_whole",
    "wrong_output",
]

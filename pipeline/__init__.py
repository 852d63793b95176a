"""The framework: stages, graphs, runs and experiments. What they are about is in `omninav.stages`.

The names that it imports are its front door.
"""

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

"""omninav.pipeline: stages, graphs and runs. It knows nothing of robots, cameras or maps."""

from .stage import Bounds, Context, Outputs, Source, Stage, State, Truth
from .value import Tick, Value

__all__ = ["Bounds", "Context", "Outputs", "Source", "Stage", "State", "Tick", "Truth", "Value"]

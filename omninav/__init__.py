"""omninav: localisation, mapping and navigation with an omnidirectional camera, as typed stages in a dataflow graph.

These names are all that a user needs; whatever else is inside may move. Each is imported when it is first used.
"""

import importlib
import os
from contextlib import suppress
from typing import TYPE_CHECKING, Any

from .working_directory import ignore_working_directory

ignore_working_directory()
with suppress(ValueError):  # it says what is no number itself
    if int(os.environ.get("NUMBA_NUM_THREADS", "1")) < 1:  # with which numba cannot be imported
        del os.environ["NUMBA_NUM_THREADS"]
os.environ.setdefault("OPENCV_IO_MAX_IMAGE_PIXELS", "100000000")  # read as OpenCV is loaded: none larger is decoded

if TYPE_CHECKING:
    from . import testing
    from .pipeline import (
        BadInput,
        Bounds,
        Context,
        Metrics,
        MetricSpec,
        MetricStage,
        Outputs,
        Plot,
        PlotStage,
        Problem,
        ProblemsFound,
        Source,
        Stage,
        State,
        Table,
        Tick,
        Truth,
        Value,
    )
    from .pipeline.api.configuration import Configuration, check, compose
    from .pipeline.api.run import Run, open_run, run
    from .pipeline.api.run import load_artifact as load_map
    from .pipeline.api.session import Session, Step, open, resume
    from .pipeline.api.sweep import Sweep, open_sweep, sweep
    from .pipeline.api.tool import tool
    from .pipeline.engine.call import StageFailed

__all__ = [
    "BadInput",
    "Bounds",
    "Configuration",
    "Context",
    "MetricSpec",
    "MetricStage",
    "Metrics",
    "Outputs",
    "Plot",
    "PlotStage",
    "Problem",
    "ProblemsFound",
    "Run",
    "Session",
    "Source",
    "Stage",
    "StageFailed",
    "State",
    "Step",
    "Sweep",
    "Table",
    "Tick",
    "Truth",
    "Value",
    "check",
    "compose",
    "load_map",
    "open",
    "open_run",
    "open_sweep",
    "resume",
    "run",
    "sweep",
    "testing",
    "tool",
]

_PLACES = {
    "testing": "testing",
    "Configuration check compose": "pipeline.api.configuration",
    "Run load_map open_run run": "pipeline.api.run",
    "Session Step open resume": "pipeline.api.session",
    "Sweep open_sweep sweep": "pipeline.api.sweep",
    "StageFailed": "pipeline.engine.call",
    "tool": "pipeline.api.tool",
}
"""Modules that define names; the others are the framework's own, for authors of stages."""
_PLACE_OF = {name: place for names, place in _PLACES.items() for name in names.split()}


def __getattr__(name: str) -> Any:
    if name == "__version__":
        from importlib.metadata import version

        return version("omninav")
    if name not in __all__:
        raise AttributeError(f"module 'omninav' has no attribute '{name}'; it has: {', '.join(__all__)}")
    module = importlib.import_module(f"omninav.{_PLACE_OF.get(name, 'pipeline')}")
    thing = module if name == "testing" else getattr(module, "load_artifact" if name == "load_map" else name)
    globals()[name] = thing
    return thing


def __dir__() -> list[str]:
    return __all__

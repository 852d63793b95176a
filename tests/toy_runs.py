"""Runs of small graphs: begun, and left to end."""

from collections.abc import Mapping
from typing import Any

from omninav.pipeline.run.execution import execute
from omninav.pipeline.run.plan import plan
from omninav.pipeline.run.run_folder import RunFolder, start


def begun(config: Mapping[str, Any]) -> RunFolder:
    """A run that has been started and has done nothing yet."""
    return start(plan(config), ["omninav", "variant=toy"])


def ended(config: Mapping[str, Any]) -> RunFolder:
    run = begun(config)
    execute(run, plan(config))
    return run

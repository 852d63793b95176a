"""Runs of small graphs: begun, and left to end."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from omninav.pipeline.run.execution import execute
from omninav.pipeline.run.prepared_run import prepare_run
from omninav.pipeline.run.run_folder import RunFolder, start
from toys import graph_of_toys

NODES = {"source": "Count", "noise": "Noise", "sum": "Add", "all": "Collected"}
WIRES = {
    "noise": {"number": "source.number"},
    "sum": {"number": "noise.number", "other": {"from": "sum.number", "delay": 1, "initial": None}},
    "all": {"numbers": {"from": "sum.number", "collect": True}},
}


def noisy_sum(runs: Path, **settings: Any) -> dict[str, Any]:
    """A configuration with state, random numbers and a sequence, which keeps a checkpoint of each tick."""
    return graph_of_toys(NODES, WIRES, variant="toy", checkpoint_s=0.0, runs=str(runs), **settings)


class Stop:
    """Stops a run after some ticks, as Ctrl-C does."""

    def update(self, name: str, done: int, total: int | None = None) -> None:
        if done == 7:
            raise KeyboardInterrupt

    def say(self, words: str) -> None:
        pass


def begun(config: Mapping[str, Any]) -> RunFolder:
    """A run that has been started and has done nothing yet."""
    return start(prepare_run(config), ["omninav", "variant=toy"])


def ended(config: Mapping[str, Any]) -> RunFolder:
    run = begun(config)
    execute(run, prepare_run(config))
    return run

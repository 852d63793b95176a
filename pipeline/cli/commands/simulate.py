"""`omninav simulate`: a simulated drive, written as a log, or sent while it is computed."""

import contextlib

from omninav.pipeline.cli.composition import complete, composed
from omninav.pipeline.engine.compile_notice import compile_notice
from omninav.pipeline.engine.engine import Engine, EngineOptions
from omninav.pipeline.report.progress import Progress
from omninav.pipeline.run.prepared_run import prepare_run

from . import tool

LIVE = ("~variant", "+graph=simulate_live")
"""Words that choose the graph that sends what it simulates."""


def is_live(arguments: list[str]) -> bool:
    """Tells whether what is simulated is sent, and not written as a log."""
    return any(word.startswith("live=") for word in arguments)


def command(arguments: list[str]) -> int:
    """Run the tool `simulate`, or with `live=…` that graph until it is stopped; neither leaves a run folder."""
    if not is_live(arguments):
        return tool.command(["simulate", *arguments])
    with Progress() as progress, compile_notice(progress.say):
        progress.say("reading the configuration")
        with composed([*LIVE, *arguments]) as config:
            prepared = prepare_run(complete(config))  # of no artifacts

        def on_tick(done: int, total: int | None) -> None:
            progress.update("simulate", done, total)

        with contextlib.suppress(KeyboardInterrupt):  # that is how it ends
            Engine(prepared.graph, {}, EngineOptions(prepared.seed, on_tick=on_tick, on_status=progress.say)).run()
    return 0

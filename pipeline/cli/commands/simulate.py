"""`omninav simulate`: what the variant `simulate` computes, written as a log."""

from omninav.pipeline.cli.composition import complete, composed
from omninav.pipeline.engine.engine import Engine, EngineOptions
from omninav.pipeline.report.progress import Progress
from omninav.pipeline.run.plan import plan


def command(arguments: list[str]) -> int:
    """Run the variant; it leaves no run folder."""
    with Progress() as progress:
        progress.say("reading the configuration")
        with composed(["variant=simulate", *arguments]) as config:
            planned = plan(complete(config))  # of no artifacts

        def on_tick(done: int, total: int | None) -> None:
            progress.update("simulate", done, total)

        Engine(planned.graph, {}, EngineOptions(planned.seed, on_tick=on_tick, on_doing=progress.say)).run()
    return 0

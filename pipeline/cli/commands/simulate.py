"""`omninav simulate`: what the variant `simulate` computes, written as a log, or sent while it is computed."""

from omninav.pipeline.cli.composition import complete, composed
from omninav.pipeline.engine.compile_notice import compile_notice
from omninav.pipeline.engine.engine import Engine, EngineOptions
from omninav.pipeline.report.progress import Progress
from omninav.pipeline.run.plan import plan


def is_live(arguments: list[str]) -> bool:
    """Whether what is simulated is sent, and not written as a log."""
    return any(word.startswith("live=") for word in arguments)


def command(arguments: list[str]) -> int:
    """Run the variant `simulate`, or with `live=…` the variant `simulate_live`; neither leaves a run folder."""
    live = is_live(arguments)
    with Progress() as progress, compile_notice(progress.say):
        progress.say("reading the configuration")
        with composed([f"variant=simulate{'_live' if live else ''}", *arguments]) as config:
            planned = plan(complete(config))  # of no artifacts

        def on_tick(done: int, total: int | None) -> None:
            progress.update("simulate", done, total)

        try:
            Engine(planned.graph, {}, EngineOptions(planned.seed, on_tick=on_tick, on_doing=progress.say)).run()
        except KeyboardInterrupt:
            return 0 if live else 130  # live it runs until it is stopped, and nothing of it is left
    return 0

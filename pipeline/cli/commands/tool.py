"""`omninav WORD WORD …`: the variant `word_word`, where it has no source: it writes a file and leaves no run."""

from omninav.pipeline.cli.composition import complete, composed
from omninav.pipeline.engine.engine import Engine, EngineOptions
from omninav.pipeline.graph.problems import BadInput
from omninav.pipeline.report.progress import Progress
from omninav.pipeline.run.plan import plan


def command(arguments: list[str]) -> int:
    """Run the variant that the first two words name."""
    variant = "_".join(arguments[:2])
    with Progress() as progress:
        progress.say("reading the configuration")
        with composed([f"variant={variant}", *arguments[2:]]) as config:
            planned = plan(complete(config))
        if planned.graph.source is not None or planned.artifacts:
            raise BadInput(f"'{variant}' is run over a log: type omninav variant={variant} …")

        def on_tick(done: int, total: int | None) -> None:
            progress.update(arguments[1], done, total)

        Engine(planned.graph, {}, EngineOptions(planned.seed, on_tick=on_tick, on_doing=progress.say)).run()
    return 0

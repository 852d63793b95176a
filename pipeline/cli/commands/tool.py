"""`omninav WORD WORD …`: the variant `word_word`, where it has no source: it writes a file and leaves no run."""

from collections.abc import Sequence
from importlib.resources import files

import yaml

from omninav.pipeline.cli.composition import complete, composed, read_words
from omninav.pipeline.cli.config_groups import CONF
from omninav.pipeline.cli.words import word_of
from omninav.pipeline.engine.engine import Engine, EngineOptions
from omninav.pipeline.graph.problems import BadInput
from omninav.pipeline.report.progress import Progress
from omninav.pipeline.run.plan import plan


def command(arguments: list[str]) -> int:
    """Run the variant that the first two words name. Words that set nothing are files: its first input."""
    variant = "_".join(arguments[:2])
    with Progress() as progress:
        progress.say("reading the configuration")
        with composed([f"variant={variant}", *_with_files_named(variant, arguments[2:])]) as config:
            planned = plan(complete(config))
        if planned.graph.source is not None or planned.artifacts:
            raise BadInput(f"'{variant}' is run over a log: type omninav variant={variant} …")

        def on_tick(done: int, total: int | None) -> None:
            progress.update(arguments[1], done, total)

        Engine(planned.graph, {}, EngineOptions(planned.seed, on_tick=on_tick, on_doing=progress.say)).run()
    return 0


def _with_files_named(variant: str, words: Sequence[str]) -> list[str]:
    """`one.png two.png` as the list of files that it is, in the setting that the variant names first of its inputs."""
    plain = [word for word in read_words(words)[0] if "=" not in word and word[:1] not in "+~"]
    text = files(CONF).joinpath(f"variant/{variant}.yaml").read_text(encoding="utf-8")
    inputs = list(yaml.safe_load(text).get("inputs") or {})
    if not plain or not inputs:
        return list(words)
    value = word_of(plain if len(plain) > 1 else plain[0])
    return [*(word for word in words if word not in plain), f"{inputs[0]}={value}"]

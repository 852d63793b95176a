"""`omninav WORD WORD …`: run a tool, which writes files and leaves no run."""

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from omegaconf import OmegaConf

from omninav.pipeline.cli.composition import composed, read_words
from omninav.pipeline.cli.overrides import parsed_words
from omninav.pipeline.cli.tools import tool_class, tools
from omninav.pipeline.engine.call import StageFailed
from omninav.pipeline.engine.compile_notice import compile_notice
from omninav.pipeline.graph.parameters import read_parameters
from omninav.pipeline.graph.ports import convert_fields
from omninav.pipeline.graph.problems import BadInput, Problem, ProblemsFound, as_bad_input
from omninav.pipeline.graph.stage import Context
from omninav.pipeline.graph.tool import Tool
from omninav.pipeline.report.progress import Progress


def command(arguments: list[str]) -> int:
    """Run the tool that the first word names, or the first two."""
    words = 1 if arguments[0] in tools() else 2
    run_tool(" ".join(arguments[:words]), arguments[words:])
    return 0


def run_tool(name: str, words: Sequence[str]) -> None:
    """Run a tool with the arguments that words give it. Raises `StageFailed` for what no reader has put into words."""
    with Progress() as progress, compile_notice(progress.say):
        tool = tool_from(tool_class(name), words)
        ctx = Context(name)
        ctx.status = progress.say
        ctx.progress = lambda done, total: progress.update(name, done, total)
        try:
            tool.run(ctx)
        except Exception as error:
            if isinstance(error, BadInput) or as_bad_input(error) is not None:
                raise
            raise StageFailed(f"omninav {name}: {type(error).__name__}: {error}") from error
        for sentence in ctx.warnings:
            print(f"warning: {sentence}", file=sys.stderr)


def tool_from(cls: type[Tool], words: Sequence[str]) -> Tool:
    """A tool with the arguments that words give it. Raises `ProblemsFound` with everything that does not fit."""
    typed, folders = read_words(words)
    plain = [word for word in typed if ("=" not in word or Path(word).exists()) and word[:1] not in "+~"]
    problems, parsed = parsed_words([word for word in typed if word not in plain])
    given = OmegaConf.create()
    if cls.groups:
        grouped = [str(word.input_line) for word in parsed if _head(word) in cls.groups]
        with composed(["~variant", *grouped, *(f"--config-dir={folder}" for folder in folders)], offer=False) as config:
            given.update({name: config[name] for name in cls.groups if name in config})
    for word in (one for one in parsed if _head(one) not in cls.groups):
        if word.is_delete() or word.is_sweep_override():
            what = "there is nothing to take out" if word.is_delete() else "several values"
            problems.append(Problem(word.key_or_group, what, "type name=value, and several as 'name=[A,B]'"))
        else:
            OmegaConf.update(given, word.key_or_group, word.value(), force_add=True)
    meant = read_parameters(cls)
    if plain:
        first = next(iter(meant))
        given[first] = plain if len(plain) > 1 else plain[0]
    values: Any = OmegaConf.to_container(given, resolve=True)
    arguments, unfit = convert_fields(values, cls, "")
    for one in unfit if not problems else ():
        if one.where in meant and one.where not in given:
            one = Problem(one.where, "it is needed", f"type {one.where}=…: {meant[one.where].meaning}")
        problems.append(one)
    if problems:
        raise ProblemsFound(problems)
    return cls(**arguments)


def _head(word: Any) -> str:
    return str(word.key_or_group).partition(".")[0]

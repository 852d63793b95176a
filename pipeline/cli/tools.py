"""The tools: commands with arguments of their own, each the class in a file that is named after what is typed."""

import dataclasses
import importlib
import inspect
from collections.abc import Sequence
from importlib.resources import files
from typing import Any

from omninav.pipeline.graph.problems import Problem, ProblemsFound
from omninav.pipeline.graph.tool import Tool

PACKAGE = "omninav.stages.tools"


def tools() -> list[str]:
    """The commands that tools are: the words that their files are named after."""
    names = (file.name for file in files("omninav.stages").joinpath("tools").iterdir())
    return sorted(name.removesuffix(".py").replace("_", " ") for name in names if name[0] != "_")


def tool_class(name: str) -> type[Tool]:
    """The class of a tool."""
    module = importlib.import_module(f"{PACKAGE}.{name.replace(' ', '_')}")
    classes = (thing for thing in vars(module).values() if inspect.isclass(thing) and issubclass(thing, Tool))
    return next(cls for cls in classes if cls.__module__ == module.__name__)


def tool_help(name: str) -> str:
    """Text of `--help`: what a tool does, an example, and its arguments with their defaults."""
    from omninav.pipeline.graph.signature import first_line, read_parameters

    cls = tool_class(name)
    lines = [f"omninav {name}     {first_line(cls)}", "", f"  omninav {name} {cls.example}", ""]
    for argument in read_parameters(cls).values():
        needed = " (required)" if argument.default is dataclasses.MISSING else ""
        lines.append(f"  {argument.name + '=' + _shown(argument.default):20} {argument.meaning}{needed}")
    return "\n".join([*lines, ""])


def _shown(default: Any) -> str:
    plain = isinstance(default, bool | int | float | str)
    return str(default).lower() if isinstance(default, bool) else str(default) if plain else "…"


def tool_from(cls: type[Tool], words: Sequence[str]) -> Tool:
    """A tool with the arguments that words give it. Raises `ProblemsFound` with everything that does not fit."""
    from omegaconf import OmegaConf

    from omninav.pipeline.graph.ports import convert_fields
    from omninav.pipeline.graph.signature import read_parameters

    from .composition import composed, read_words
    from .overrides import parsed_words

    typed, folders = read_words(words)
    plain = [word for word in typed if "=" not in word and word[:1] not in "+~"]
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

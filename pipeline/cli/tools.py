"""The tools: commands with arguments of their own, each the class in a file that is named after what is typed."""

import dataclasses
import importlib
import inspect
from importlib.resources import files
from typing import Any

from omninav.pipeline.graph.parameters import first_line, read_parameters
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
    cls = tool_class(name)
    lines = [f"omninav {name}     {first_line(cls)}", "", f"  omninav {name} {cls.example}", ""]
    for argument in read_parameters(cls).values():
        needed = " (required)" if argument.default is dataclasses.MISSING else ""
        lines.append(f"  {argument.name + '=' + _shown(argument.default):20} {argument.meaning}{needed}")
    return "\n".join([*lines, ""])


def _shown(default: Any) -> str:
    plain = isinstance(default, bool | int | float | str)
    return str(default).lower() if isinstance(default, bool) else str(default) if plain else "…"

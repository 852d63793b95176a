"""Tools, called from Python."""

from typing import Any

from omninav.pipeline.cli.commands.tool import run_tool
from omninav.pipeline.cli.tools import tools
from omninav.pipeline.graph.problems import BadInput, suggest

from .arguments import setting_argument
from .plain_errors import plain_errors


@plain_errors()
def tool(name: str, *words: str, **arguments: Any) -> None:
    """Run a command that writes files, as `tool("simulate", log="drive.mcap")`.

    Words and arguments are those of the command line, which `omninav simulate --help` explains. Raises
    `ProblemsFound`, `BadInput`, or `StageFailed` where it could not continue.
    """
    if name not in tools():
        raise BadInput(f"'{name}': there is no such tool; {suggest(name, tools(), 'tools')}")
    run_tool(name, [*words, *(setting_argument(key, value) for key, value in arguments.items())])

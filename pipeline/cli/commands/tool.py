"""`omninav WORD WORD …`: run a tool, which writes files and leaves no run."""

from collections.abc import Sequence

from omninav.pipeline.cli.tool_words import tool_from
from omninav.pipeline.cli.tools import tool_class, tools
from omninav.pipeline.engine.call import StageFailed
from omninav.pipeline.engine.compile_notice import compile_notice
from omninav.pipeline.graph.problems import BadInput, as_bad_input
from omninav.pipeline.graph.stage import Context
from omninav.pipeline.report.progress import Progress


def command(arguments: list[str]) -> int:
    """Run the tool that the first word names, or the first two."""
    words = 1 if arguments[0] in tools() else 2
    run_tool(" ".join(arguments[:words]), arguments[words:])
    return 0


def run_tool(name: str, words: Sequence[str]) -> None:
    """Run a tool with the arguments that words give it. Raises `StageFailed` for what no reader has put into words."""
    with Progress() as progress, compile_notice(progress.say):
        progress.say("reading the arguments")
        tool = tool_from(tool_class(name), words)
        ctx = Context(name)
        ctx.doing = progress.say
        ctx.progress = lambda done, total: progress.update(name, done, total)
        try:
            tool.run(ctx)
        except Exception as error:
            if isinstance(error, BadInput) or as_bad_input(error) is not None:
                raise
            raise StageFailed(f"omninav {name}: {type(error).__name__}: {error}") from error

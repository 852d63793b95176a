"""`omninav explain`: where a run was not tracked, and why."""

from . import tool


def command(arguments: list[str]) -> int:
    """Run the tool `explain`."""
    return tool.command(["explain", *arguments])

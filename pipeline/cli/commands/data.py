"""`omninav data`: public data sets that can be read, and where to get them."""

from . import tool


def command(arguments: list[str]) -> int:
    """Run the tool `data`."""
    return tool.command(["data", *arguments])

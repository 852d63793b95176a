"""`omninav video`: a video of a run."""

from . import tool


def command(arguments: list[str]) -> int:
    """Run the tool `video`."""
    return tool.command(["video", *arguments])

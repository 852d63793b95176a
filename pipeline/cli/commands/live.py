"""`omninav live`: a variant whose frames come now, until it is told to stop."""

from omninav.pipeline.cli.commands.run import command as run

SETTINGS = ("source=live", "publish=ros2", "log=live")
"""What makes a run live, each where nothing else is typed."""


def command(arguments: list[str]) -> int:
    """Run a variant live. Whatever else may be typed for a run may be typed here."""
    typed = {word.partition("=")[0] for word in arguments}
    return run([*(word for word in SETTINGS if word.partition("=")[0] not in typed), *arguments])

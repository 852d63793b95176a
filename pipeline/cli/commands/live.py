"""`omninav live`: a variant whose frames come now, until it is told to stop."""

from omninav.pipeline.cli.commands.run import command as run

SETTINGS = ("source=live", "publish=ros2", "log=live")
"""What makes a run live, each where nothing else is typed."""


def command(arguments: list[str]) -> int:
    """Run a variant live. Whatever else may be typed for a run may be typed here."""
    typed = dict(word.split("=", 1) for word in arguments if "=" in word)
    if typed.get("log", "live") != "live":
        typed.setdefault("publish", "")  # what is plugged into this computer has nobody to tell it to
    return run([*(word for word in SETTINGS if word.partition("=")[0] not in typed), *arguments])

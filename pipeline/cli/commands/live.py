"""`omninav live`: run a variant on frames that arrive now, until it is stopped."""

from collections.abc import Mapping
from typing import Any

from omninav.pipeline.cli.commands.run import command as run
from omninav.pipeline.graph.problems import BadInput, ProblemsFound
from omninav.pipeline.run.prepared_run import PreparedRun, prepare_run

SETTINGS = ("source=live", "publish=ros2", "log=live")
"""Settings that make a run live, each where nothing else is typed."""

RESULTS = ("estimate", "command")
"""Ports of the node `publish`, one of which a live run has something for."""


def command(arguments: list[str]) -> int:
    """Run a variant live. It takes all that a run takes."""
    return run(live_words(arguments), prepare_live)


def live_words(arguments: list[str]) -> list[str]:
    """Gives the words of `omninav` or `omninav check` that replace those typed behind `omninav live`."""
    typed = dict(word.split("=", 1) for word in arguments if "=" in word)
    if typed.get("log", "live") != "live":
        typed.setdefault("publish", "")  # a device of this computer has no subscriber
    return [*(word for word in SETTINGS if word.partition("=")[0] not in typed), *arguments]


def prepare_live(settings: Mapping[str, Any]) -> PreparedRun:
    """Check a configuration. Raises `BadInput` where its variant is none of what runs live."""
    try:
        prepared = prepare_run(settings)
        told = {wire.to_port for wire in prepared.graph.wires if wire.to_node == "publish"}
        why_not = "it has neither an estimate nor a command to publish" if told and told.isdisjoint(RESULTS) else ""
    except ProblemsFound as found:
        if not all(problem.where.startswith("wires.") for problem in found.problems):
            raise
        why_not = f"{found.problems[0].where}: {found.problems[0].what}"
    if why_not:
        raise BadInput(
            f"variant={settings.get('variant')} does not run live ({why_not}); take another: omninav variants"
        )
    return prepared

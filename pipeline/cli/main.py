"""The command line: what is heavy is imported by the command that needs it."""

import importlib
import os
import sys
from collections.abc import Sequence
from pkgutil import iter_modules

from omninav.pipeline.graph.problems import BadInput, ProblemsFound, as_bad_input, nearest, suggest
from omninav.pipeline.report.terminal_text import cleaned

from . import commands
from .arguments import refuse_twice, refuse_unreadable, without_flags
from .config_groups import LEARN, group_files, learnable, refuse_null_groups
from .help import asks_for_help, help_text
from .output import lost_output, mend_streams
from .tools import tools
from .typing_mistakes import command_first, mistyped_word, with_homes

COMMANDS = tuple(each.name for each in iter_modules(commands.__path__) if each.name not in ("run", "tool"))
"""Each is the function `command` of its module in `commands`; all else is a tool, or runs a variant or experiment."""

WITHOUT_CONFIGURATION = ("stages", "report", "compare", "resume", "doctor")
"""Those that compose none, and have no use for flags of it."""


def main(argv: Sequence[str] | None = None) -> int:
    """Run a command and return its exit code: 0 well, 1 a stage failed, 2 the configuration or an input is wrong."""
    before = sys.stdout, sys.stderr
    mend_streams()
    try:
        with cleaned(sys.stdout, sys.stderr):
            code = _run(list(sys.argv[1:] if argv is None else argv))
        lost = lost_output()
        if lost is not None:
            print(f"standard output: {lost.strerror}; what was printed is lost, all else was done", file=sys.stderr)
        return code if lost is None else code or 2
    except BrokenPipeError:
        return 0
    finally:
        sys.stderr.flush()
        sys.stdout, sys.stderr = before


def _run(arguments: list[str]) -> int:
    arguments = with_homes(command_first(arguments))
    if asks_for_help(arguments):
        print(help_text(arguments), end="")
        return 0
    if arguments and arguments[0] == "--version":
        from omninav import __version__

        print("omninav", __version__)
        return 0
    mistyped = mistyped_word(arguments)
    if mistyped:
        print(mistyped, file=sys.stderr)
        return 2
    os.environ["PYTHONSAFEPATH"] = "1"  # processes of ours do not import from the working directory
    if arguments and arguments[0] in COMMANDS:
        name, arguments = arguments[0], arguments[1:]
    elif {*arguments[:1], " ".join(arguments[:2])} & {*tools()}:
        name = "tool"
    elif arguments[:1] and arguments[0] in learnable() and not any(word.isidentifier() for word in arguments[1:2]):
        name, arguments = "run", [f"{LEARN}={arguments[0]}", *arguments[1:]]
    elif arguments and arguments[0].isidentifier():
        return _unknown_command(*arguments[:2])
    else:
        name = "run"
    try:
        refuse_unreadable(arguments)
        _refuse_lost_folder()
        refuse_null_groups(arguments)
        refuse_twice(arguments)
        if name in WITHOUT_CONFIGURATION:
            arguments = without_flags(arguments)
        command = importlib.import_module(f"omninav.pipeline.cli.commands.{name}").command
        return int(command(arguments))
    except KeyboardInterrupt as stopped:
        on = "the same command" if hasattr(stopped, "folder") else ""  # of a run that was resumed
        if "-m" in arguments or "--multirun" in arguments:
            on = "the same command with hydra.sweep.dir=FOLDER of this sweep"
        print(f"stopped; {on} continues it" if on else "stopped", file=sys.stderr)
        return 130
    except (ProblemsFound, BadInput) as error:
        print(error, file=sys.stderr)
        return 2
    except BrokenPipeError:
        return 0
    except Exception as error:
        from omninav.pipeline.engine.call import StageFailed

        cause = error.__cause__ if isinstance(error, StageFailed) else error
        bad = as_bad_input(cause) if cause is not None else None
        if bad is None and not isinstance(error, StageFailed):
            raise
        print(bad or error, file=sys.stderr)
        return 1 if bad is None else 2


def _refuse_lost_folder() -> None:
    try:
        os.getcwd()
    except OSError:
        raise BadInput("the folder that you are in is gone; change to another: cd FOLDER") from None


def _unknown_command(name: str, second: str = "") -> int:
    variants = {file.name.removesuffix(".yaml") for file in group_files("variant")}
    longer = [one.removeprefix(f"{name} ") for one in tools() if one.startswith(f"{name} ")]
    both = f"{name}_{second}"
    if {name, both} & variants:
        hint = f"type omninav variant={both if both in variants else name}"
    elif longer:
        listing = ", ".join(f"omninav {name} {one}" for one in longer)
        name, near = f"{name} {second}".strip(), nearest(second, longer)
        hint = (
            f"there are: {listing}"
            if near is None
            else f"did you mean 'omninav {name.split()[0]} {near}'? there are: {listing}"
        )
    elif os.path.exists(name):
        hint = f"a file or folder is typed behind the setting that reads it: omninav log={name}"
    else:
        hint = suggest(name, {*COMMANDS, *(tool.partition(" ")[0] for tool in tools())}, "commands", prefix="omninav ")
    print(f"'{name}' is no command. {hint}", file=sys.stderr)
    return 2

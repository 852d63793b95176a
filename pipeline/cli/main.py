"""The command line: what is heavy is imported by the command that needs it."""

import importlib
import os
import sys
from collections.abc import Sequence
from importlib.resources import files

COMMANDS = ("check", "graph", "stages", "variants", "simulate", "report", "compare", "resume", "experiments", "doctor")
"""Each is the function `command` of its module in `commands`; everything else runs a variant or an experiment."""


def main(argv: Sequence[str] | None = None) -> int:
    """Run a command and return its exit code: 0 well, 1 a stage failed, 2 the configuration or an input is wrong."""
    arguments = list(sys.argv[1:] if argv is None else argv)
    if arguments and arguments[0] in ("-h", "--help", "help"):
        print(files("omninav.conf").joinpath("help.txt").read_text(encoding="utf-8"), end="")
        return 0
    if arguments and arguments[0] == "--version":
        from importlib.metadata import version

        print("omninav", version("omninav"))
        return 0
    if os.getcwd() not in sys.path:
        sys.path.append(os.getcwd())  # so that `_target_: my_stages.MyMatch` finds my_stages.py here
    if arguments and arguments[0] in COMMANDS:
        name, arguments = arguments[0], arguments[1:]
    elif arguments and arguments[0].isidentifier():
        return _unknown_command(arguments[0])
    else:
        name = "run"
    try:
        from omninav.pipeline.graph.problems import BadInput, ProblemsFound, unreadable_yaml

        from .config_groups import refuse_null_groups

        refuse_null_groups(arguments)
        command = importlib.import_module(f"omninav.pipeline.cli.commands.{name}").command
        return int(command(arguments))
    except KeyboardInterrupt:  # it may come before anything is imported, so it stands first
        print("stopped; `omninav resume runs/latest` goes on", file=sys.stderr)
        return 130
    except (ProblemsFound, BadInput) as error:
        print(error, file=sys.stderr)
        return 2
    except BrokenPipeError:
        return 0
    except OSError as error:  # a full disk, a folder that cannot be written to, a link in place of a file
        print(f"{error.filename or 'a file'}: {error.strerror or error}", file=sys.stderr)
        return 2
    except Exception as error:
        bad = unreadable_yaml(error)
        if bad is None:
            raise
        print(bad, file=sys.stderr)
        return 2


def _unknown_command(name: str) -> int:
    from omninav.pipeline.graph.problems import suggest

    print(f"'{name}' is no command. {suggest(name, COMMANDS, 'commands', prefix='omninav ')}", file=sys.stderr)
    return 2

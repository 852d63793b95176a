"""The command line: what is heavy is imported by the command that needs it."""

import importlib
import os
import sys
from collections.abc import Sequence

COMMANDS = ("check", "graph", "stages", "variants", "simulate", "report", "compare", "resume", "doctor")
"""Each is the function `command` of its module in `commands`; everything else runs a variant or an experiment."""

HELP = """\
omninav: finding the way with an omnidirectional camera

  omninav                                        the built-in world: a map, a drive, a report
  omninav variant=omniview_mcl tour=T log=L      learn the map from a tour, localise a drive with it
  omninav variant=omniview_mcl map=M log=L       the same with a map that was saved before
  omninav -m match=selective,l2 seed=0,1,2       a sweep: every combination, one page
  omninav +experiment=omniview_mcl/table_1       a paper's table, its figures beside ours (profile=quick: small)
  omninav resume runs/latest                     go on with a run that was stopped
  omninav compare runs/A runs/B                  figures side by side

  check [overrides]       report everything that is wrong with a configuration, and run nothing
  graph [overrides]       draw the graph: SVG and Mermaid (out=FOLDER)
  stages [role | stage]   all stages; of one stage its ports, parameters, source and use
  variants                what variant= can be, and the inputs of each
  simulate [overrides]    write a log of the built-in world (world=… route=… day=… log=out.mcap)
  report [run]            a run's results and where its report lies
  compare RUN RUN …       several runs side by side
  resume RUN              go on with a run that was stopped
  doctor                  versions, plugins, and what may be missing

A log is an .mcap file, a rosbag2 folder, a ROS 1 .bag, LAYOUT:FOLDER for images with CSVs (antworld:path), or a
recording's .yaml. Any parameter can be set: nodes.match.headings=72; any stage swapped: match=l2.
Hydra's own flags work as ever: --config-dir, --cfg job, --multirun, --info, --hydra-help; hydra.run.dir and
hydra.sweep.dir decide where a run's files lie.
"""


def main(argv: Sequence[str] | None = None) -> int:
    """Run a command and return its exit code: 0 well, 1 a stage failed, 2 the configuration or an input is wrong."""
    arguments = list(sys.argv[1:] if argv is None else argv)
    if arguments and arguments[0] in ("-h", "--help", "help"):
        print(HELP, end="")
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
    from omninav.pipeline.graph.problems import BadInput, ProblemsFound, unreadable_yaml

    from .config_groups import refuse_null_groups

    try:
        refuse_null_groups(arguments)
        command = importlib.import_module(f"omninav.pipeline.cli.commands.{name}").command
        return int(command(arguments))
    except (ProblemsFound, BadInput) as error:
        print(error, file=sys.stderr)
        return 2
    except BrokenPipeError:
        return 0
    except KeyboardInterrupt:
        print("stopped; `omninav resume runs/latest` goes on", file=sys.stderr)
        return 130
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

"""`omninav resume`: continue a run or an experiment that was stopped."""

import os
import shlex
import sys
from contextlib import chdir
from pathlib import Path

from omninav.pipeline.cli.arguments import read_flags, refuse_unreadable
from omninav.pipeline.cli.terminal import show_results
from omninav.pipeline.engine.call import StageFailed
from omninav.pipeline.files import Damaged, read_json
from omninav.pipeline.graph.ports import convert
from omninav.pipeline.graph.problems import BadInput, one_line
from omninav.pipeline.graph.registry import only_listed
from omninav.pipeline.report.progress import Progress
from omninav.pipeline.run.resume import no_run, resume


def command(arguments: list[str]) -> int:
    """Continue the run in a folder from where it was stopped.

    Of the stages that the folder names, those that `omninav stages` lists are run; others only where their module or
    file is typed after the folder, and programs (`command=`) only where they are.
    """
    if not arguments or any(map(os.path.isdir, arguments[1:])):
        raise BadInput("resume: give one run folder: omninav resume runs/latest")
    given, *typed = arguments
    folder = Path(os.path.realpath(given))
    if not folder.is_dir():
        raise no_run(folder)
    with only_listed(typed):
        return _resume_experiment(folder) if (folder / "experiment.json").is_file() else _resume_run(given, folder)


def _resume_run(given: str, folder: Path) -> int:
    try:
        with chdir("."), Progress() as progress:  # a run continues where it was started, and the command ends here
            run, metrics = resume(folder, progress)
    except StageFailed as failed:
        print(f"{failed}\nthe traceback is in {folder / 'run.log'}", file=sys.stderr)
        return 1
    if run.complete:
        print(f"{given} was complete: there was nothing to continue. Its results:")
    show_results(run.folder, metrics, run.manifest)
    return 0


def _resume_experiment(folder: Path) -> int:
    """An experiment continues when its command is typed again, where it was typed."""
    from .run import command as run

    file = folder / "experiment.json"
    try:
        manifest = read_json(file)
    except Damaged as damaged:
        raise BadInput(f"{damaged}; type the experiment's command again: what it has done is kept") from None
    argv, problems = convert(manifest.get("argv"), tuple[str, ...], "argv")
    place, more = convert(manifest.get("cwd"), Path, "cwd")
    if problems or more or not argv:
        raise BadInput(f"{file}: it does not state how the experiment was started; type its command again")
    words = list(argv[1:])
    refuse_unreadable(words)
    if read_flags(words).multirun:  # whose jobs would not know what was typed
        raise BadInput(f"{file}: it is of a sweep, not of an experiment; type the sweep's command again")
    print(f"{one_line(shlex.join(['omninav', *words]))}   (in {place})", flush=True)
    os.chdir(place)
    return run(words)

"""`omninav resume`: go on with a run or an experiment that was stopped."""

import os
import shlex
import sys
from pathlib import Path

from omninav.pipeline.cli.terminal import show, shown
from omninav.pipeline.engine.call import StageFailed
from omninav.pipeline.files import Damaged, read_json
from omninav.pipeline.graph.problems import BadInput
from omninav.pipeline.report.progress import Progress
from omninav.pipeline.report.terminal_tables import results_table
from omninav.pipeline.run.resume import resume


def command(arguments: list[str]) -> int:
    """Go on with the run in a folder, from where it was stopped."""
    if len(arguments) != 1:
        raise BadInput("resume: give one run folder: omninav resume runs/latest")
    here, folder = Path.cwd(), Path(arguments[0]).resolve()
    if (folder / "experiment.json").is_file():
        return _resume_experiment(folder)
    try:
        with Progress() as progress:
            run, metrics = resume(folder, progress)
    except StageFailed as failed:
        print(f"{failed}\nthe traceback is in {folder / 'run.log'}", file=sys.stderr)
        return 1
    finally:
        os.chdir(here)  # a run goes on where it was started
    if run.complete:
        print(f"{arguments[0]} was complete: there was nothing to go on with. Its results:")
    show(results_table(metrics))
    print(f"report: {shown(run.folder / 'report.html')}")
    return 0


def _resume_experiment(folder: Path) -> int:
    """An experiment goes on when its command is typed again, where it was typed."""
    from .run import command as run

    try:
        manifest = read_json(folder / "experiment.json")
    except Damaged as damaged:
        raise BadInput(f"{damaged}; type the experiment's command again: what it has done is found again") from None
    words, place = manifest["argv"][1:], Path(manifest["cwd"])
    print(f"{shlex.join(['omninav', *words])}   (in {place})", flush=True)
    os.chdir(place)
    return run(words)

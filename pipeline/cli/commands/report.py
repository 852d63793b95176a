"""`omninav report`: a run's results, and the path of its report; with `plots=all` drawn again."""

import os
import shlex
from pathlib import Path

from omninav.pipeline.cli.jobs import show_sweep
from omninav.pipeline.cli.terminal import show, shown
from omninav.pipeline.graph.problems import BadInput
from omninav.pipeline.graph.registry import only_listed
from omninav.pipeline.report.progress import Progress
from omninav.pipeline.report.terminal_tables import results_table
from omninav.pipeline.run.metrics_files import read_metrics, refuse_experiment


def command(arguments: list[str]) -> int:
    """Print the results of a run that ended (the latest where none is named); with `plots=…` draw its report again.

    That runs it once more: as of a run that continues, other code than `omninav stages` lists is typed after the
    folder.
    """
    plots = [word.removeprefix("plots=") for word in arguments if word.startswith("plots=")]
    named = [word for word in arguments if not word.startswith("plots=")]
    if any(map(os.path.isdir, named[1:])):
        several = shlex.join(["omninav", "compare", *named])
        raise BadInput(f"report: give one run folder: omninav report runs/latest; several side by side: {several}")
    folder = Path(named[0] if named else "runs/latest").absolute()
    with only_listed(named[1:]), Progress() as progress:
        if plots:
            from omninav.pipeline.run.redraw import redraw

            redraw(folder, plots[-1], progress)
    if (folder / "sweep.html").is_file():
        show_sweep(folder)
        return 0
    if not (folder / "report.html").is_file():
        if not named and not folder.is_dir():
            raise BadInput("report: there is no runs/latest here; type omninav report FOLDER")
        if not folder.is_dir():
            raise BadInput(f"{folder}: there is no such folder; `ls runs` shows what there is")
        refuse_experiment(folder)
        if not (folder / "manifest.json").is_file():
            raise BadInput(f"{folder}: there is no run in it; `ls runs` shows what there is")
        raise BadInput(
            f"{folder}: no report.html in it; `omninav resume {shlex.quote(str(folder))}` continues a run that did "
            "not end"
        )
    show(results_table(read_metrics(folder)))
    print(f"report: {shown(folder / 'report.html')}")
    return 0

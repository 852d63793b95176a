"""`omninav report`: a run's results, and where its report lies."""

from pathlib import Path

from omninav.pipeline.cli.terminal import show
from omninav.pipeline.graph.problems import BadInput
from omninav.pipeline.report.terminal_tables import results_table
from omninav.pipeline.run.metrics_files import read_metrics


def command(arguments: list[str]) -> int:
    """Print the results of a run that ended (the latest where none is named)."""
    folder = Path(arguments[0] if arguments else "runs/latest")
    if not (folder / "report.html").is_file():
        raise BadInput(f"{folder}: no report.html in it; `omninav resume {folder}` goes on with a run that did not end")
    show(results_table(read_metrics(folder)))
    print(f"report: {folder / 'report.html'}")
    return 0

"""`omninav compare`: several runs side by side."""

from pathlib import Path

from omninav.pipeline.cli.terminal import show
from omninav.pipeline.graph.problems import BadInput
from omninav.pipeline.graph.small_files import read_mapping
from omninav.pipeline.report.terminal_tables import compare_table
from omninav.pipeline.run.metrics_files import read_metrics


def command(arguments: list[str]) -> int:
    """Print the metrics of two or more runs, and what they differ in."""
    words = [run for given in arguments for run in runs_in(given)]
    if len(words) < 2:
        raise BadInput("compare: give two or more run folders: omninav compare runs/A runs/B")
    runs = []
    for word in words:
        folder = Path(word)
        metrics = read_metrics(folder)
        config = read_mapping(folder / "config.yaml")
        manifest = read_mapping(folder / "manifest.json")
        runs.append({"name": word.rstrip("/"), "metrics": metrics, "config": config, "manifest": manifest})
    show(compare_table(runs))
    return 0


def runs_in(given: str) -> list[str]:
    """The run folders that a word names: itself, or of a sweep's folder all jobs that ended."""
    folder = Path(given)
    if not (folder / "sweep.html").is_file():
        return [given]
    jobs = [file.parent for file in folder.glob("*/metrics.json")]
    return [str(job) for job in sorted(jobs, key=lambda job: (len(job.name), job.name))]

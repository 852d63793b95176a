"""One job: a run or an experiment that Hydra calls, alone or as one of a sweep. It never raises and never exits."""

import json
import os
import sys
import traceback
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from hydra.core.hydra_config import HydraConfig
from hydra.types import RunMode
from omegaconf import OmegaConf

from omninav.pipeline.engine.call import StageFailed
from omninav.pipeline.engine.compile_notice import compile_notice
from omninav.pipeline.files import locked, write_json
from omninav.pipeline.graph.problems import BadInput, ProblemsFound, as_bad_input
from omninav.pipeline.report.progress import Progress
from omninav.pipeline.report.sweep_page import write_sweep_page
from omninav.pipeline.report.sweep_table import overview_of
from omninav.pipeline.run.execution import execute
from omninav.pipeline.run.metrics_files import read_metrics
from omninav.pipeline.run.prepared_run import Prepare, prepare_run
from omninav.pipeline.run.resume import command_to_resume, resume
from omninav.pipeline.run.run_folder import Interrupted, start, was_started

from .composition import complete
from .objective import check_objective, objective_of
from .terminal import show, show_report, show_results, shown, terminal_width

OUTCOMES = "OMNINAV_OUTCOMES"
"""Names the file in which jobs, also those in other processes, leave their exit codes and their sweep's page."""
NO_FOLDER = "."
"""Hydra's `run.dir` where nobody has set it: then a run's folder is made from the date and the variant."""


@dataclass(frozen=True)
class SweepJob:
    """A job of a sweep: the sweep's folder, the job's own, its number, and what it overrides."""

    sweep: Path
    folder: Path
    number: str
    overrides: tuple[str, ...]


@dataclass(frozen=True)
class JobEnd:
    """End of a job; plain data."""

    code: int = 0
    """Its exit code."""
    error: str = ""
    """Error, in one line."""
    objective: float | None = None
    log: str = ""
    """The file with the traceback."""
    sweep: str = ""
    """The folder of its sweep; '' where it is alone."""
    number: str = ""
    """Its number in the sweep."""

    def spoilt(self, error: OSError) -> "JobEnd":
        """The same end; where it was well, a failure to write what belongs to it."""
        return replace(self, code=self.code or 2, error=self.error or str(as_bad_input(error)))


def run_job(config: Any, arguments: Sequence[str], prepare: Prepare = prepare_run) -> float | None:
    """Run what a configuration describes, report how it ended, and return its objective, if one is named (see `_run`).

    In a sweep the other jobs continue; the exit code is left in a file. A job that fails returns None, which Optuna
    counts as a failed trial (NaN would end the whole sweep).
    """
    end, page = ended(config, arguments, prepare), None
    if end.sweep:
        try:
            page = write_page(Path(end.sweep))
        except OSError as error:
            end = end.spoilt(error)
    report_end(end)
    leave_outcome(end, page)
    return end.objective


def ended(config: Any, arguments: Sequence[str], prepare: Prepare = prepare_run) -> JobEnd:
    """Run what a configuration describes. By then the manifest of a sweep's job records how that ended."""
    sweep, folder = _sweep_job(), _folder()
    of_experiment = config.get("experiment") is not None
    code, error, objective = 0, "", None
    try:
        if of_experiment and sweep is not None:
            raise BadInput("an experiment has its own sweep: leave out -m, and write what varies into its file")
        if of_experiment:
            from .composed_experiments import run_experiment  # with pages and plots, which no other job needs

            code = run_experiment(config, arguments)
        else:
            objective = _run(config, sweep, folder, prepare)
    except (ProblemsFound, BadInput) as wrong:
        code, error = 2, str(wrong)
    except StageFailed as failed:
        of_a_file = as_bad_input(failed.__cause__) if failed.__cause__ is not None else None
        code, error = (1, str(failed)) if of_a_file is None else (2, f"{of_a_file} ({failed})")
    except Interrupted as stopped:
        code, error = 130, f"stopped; `{command_to_resume(stopped.folder, shown(stopped.folder))}` continues it"
    except KeyboardInterrupt:
        code, error = 130, "stopped; the same command continues it" if of_experiment else "stopped before it had begun"
    except BrokenPipeError:
        pass  # the reader of what is printed has gone
    except Exception as unknown:  # a defect of ours: one line here, the trace in run.log
        known = as_bad_input(unknown)
        code, error = (2, str(known)) if known else (1, f"{type(unknown).__name__}: {unknown}")
        if known is None and sweep is None:
            traceback.print_exc()
    log = (folder or Path(str(config.get("runs", "runs"))) / "latest") / "run.log"
    trace = str(log) if error and code == 1 and log.is_file() else ""
    if sweep is None:
        if folder is not None and folder.is_dir() and not any(folder.iterdir()):
            folder.rmdir()  # Hydra has made it, and nothing has run
        return JobEnd(code, error, objective, trace)
    return note_end(sweep, JobEnd(code, error, objective, trace, str(sweep.sweep), sweep.number))


def report_end(end: JobEnd) -> None:
    """Say what went wrong with a job, if anything has."""
    if end.error:
        print(f"job {end.number}: {end.error}" if end.sweep else end.error, file=sys.stderr, flush=True)
    if end.log:
        print(f"the traceback is in {shown(Path(end.log))}", file=sys.stderr, flush=True)


def leave_outcome(end: JobEnd, page: Path | None) -> None:
    """Leave a job's exit code, and its sweep's page, where the command finds them."""
    if OUTCOMES in os.environ:
        with open(os.environ[OUTCOMES], "a", encoding="utf-8") as file:
            file.write(f"{end.code} {page or ''}\n")


def _run(config: Any, sweep: SweepJob | None, folder: Path | None, prepare: Prepare) -> float | None:
    """Run a configuration. Returns its `objective`, None where none is named."""
    settings = complete(config)
    if sweep is not None and settings.get("plots") == "auto":
        settings["plots"] = "none"
    prepared = prepare(settings)
    check_objective(settings.get("objective"), prepared.graph)
    if sweep is None and folder is not None:
        no_run_in(folder)
    if sweep is not None and (other := _left_in(sweep.folder).get("job", sweep.number)) != sweep.number:
        own = "hydra.sweep.subdir='${hydra.job.num}'"
        raise BadInput(f"{sweep.folder}: job {other} has left its run there; give each job its own folder: {own}")
    argv = ["omninav", *(sweep.overrides if sweep else sys.argv[1:])]
    with Progress() as progress, compile_notice(progress.say):
        if sweep is not None and folder is not None and was_started(folder, prepared):
            run, metrics = resume(folder, progress)  # the sweep was stopped and is typed again, or this job has died
        else:
            run = start(prepared, argv, folder, _hydra_files(config))
            try:
                metrics = execute(run, prepared, progress)
            except KeyboardInterrupt:
                if run.manifest["status"] != "complete":
                    raise
                metrics = read_metrics(run.folder)
    if sweep is None:
        try:
            show_results(run.folder, metrics, run.manifest)
        except KeyboardInterrupt:  # too late to stop anything
            show_results(run.folder, metrics, run.manifest)
    else:
        show_report(run.folder)
    return objective_of(metrics, settings["objective"]) if settings.get("objective") else None


def no_run_in(folder: Path, setting: str = "hydra.run.dir") -> Path:
    """The folder itself. Raises `BadInput` where there is a run in it, or a file, which a run might overwrite.

    `setting`: names the folder.
    """
    if (folder / "manifest.json").exists():
        raise BadInput(f"{folder}: there is a run in it; `omninav resume` continues it, {setting}=… names another")
    ours = ("config.yaml", "graph.svg", "graph.mmd") if (folder / ".lock").is_file() else ()  # of one that never began
    files = sorted({file.name for file in folder.glob("[!.]*") if file.is_file()}.difference(ours))
    if files:
        raise BadInput(f"{folder}: it holds {', '.join(files[:3])}, which a run might overwrite; name an empty folder")
    return folder


def _hydra_files(config: Any) -> dict[str, str]:
    """Files that Hydra's users look for in the folder of a job."""
    settings = HydraConfig.get()
    return {
        ".hydra/config.yaml": OmegaConf.to_yaml(config),
        ".hydra/hydra.yaml": OmegaConf.to_yaml(OmegaConf.create({"hydra": settings})),
        ".hydra/overrides.yaml": OmegaConf.to_yaml(settings.overrides.task),
    }


def _folder() -> Path | None:
    """Folder into which Hydra puts the job's files; None where nobody has set it."""
    settings = HydraConfig.get()
    chosen = any(str(word).startswith("hydra.run.dir=") for word in settings.overrides.hydra)
    if settings.mode == RunMode.MULTIRUN or chosen or settings.run.dir != NO_FOLDER:
        return Path(settings.runtime.output_dir)
    return None


def _sweep_job() -> SweepJob | None:
    settings = HydraConfig.get()
    if settings.mode != RunMode.MULTIRUN:
        return None
    sweep, own = Path(settings.sweep.dir).resolve(), Path(settings.runtime.output_dir)
    return SweepJob(sweep, own, str(settings.job.num), tuple(settings.overrides.task))


def _left_in(folder: Path) -> dict[str, Any]:
    """The manifest of the run that a job left in a folder; empty where there is none."""
    file = folder / "manifest.json"
    return dict(json.loads(file.read_text(encoding="utf-8"))) if file.exists() else {}


def note_end(job: SweepJob, end: JobEnd) -> JobEnd:
    """Put a job's end into its manifest, where its sweep's page finds it; not into that of another job.

    Returns the end: a failure where it cannot be written.
    """
    try:
        manifest = _left_in(job.folder) or {"status": "refused"}
        if manifest.get("job", job.number) == job.number:
            manifest |= {"job": job.number, "overrides": job.overrides} | ({"error": end.error} if end.error else {})
            write_json(job.folder / "manifest.json", manifest)
    except OSError as error:
        return end.spoilt(error)
    return end


def write_page(sweep: Path) -> Path:
    """Write a sweep's page as far as it has run. Jobs in other processes wait for each other here."""
    with locked(sweep / ".page.lock"):
        return write_sweep_page(sweep, _sweep_rows(sweep))


def show_sweep(folder: Path) -> None:
    """Print a sweep's means, what is the same in all of it, and where its page is."""
    from omninav.pipeline.report.terminal_tables import sweep_table

    sweep = overview_of(_sweep_rows(folder))
    if sweep.heads:
        show(sweep_table(sweep, terminal_width()))
    if sweep.same:
        print(f"the same in all jobs: {', '.join(sweep.same)}")
    print(f"sweep: {shown(folder / 'sweep.html')}", flush=True)


def _sweep_rows(sweep: Path) -> list[dict[str, Any]]:
    """Rows of a sweep's tables, in the order of its jobs."""
    rows = []
    for file in sweep.rglob("manifest.json"):
        manifest, folder = json.loads(file.read_text(encoding="utf-8")), file.parent
        if "job" in manifest:
            metrics = read_metrics(folder) if (folder / "metrics.json").exists() else None
            rows.append({"job": manifest["job"], "folder": folder, "manifest": manifest, "metrics": metrics})
    return sorted(rows, key=lambda row: int(row["job"]))

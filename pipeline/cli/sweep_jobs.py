"""The jobs of a sweep that `executor=…` runs: how they are given to it, and how one of them runs there."""

import copy
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict
from pathlib import Path
from typing import Any

from hydra.core.hydra_config import HydraConfig
from hydra.types import RunMode
from omegaconf import OmegaConf, open_dict, read_write

from omninav.pipeline.jobs.executors import read_executor
from omninav.pipeline.jobs.job import Job, Outcome, Send
from omninav.pipeline.jobs.throttle import Throttle
from omninav.pipeline.jobs.worker_pool import WorkerPool
from omninav.pipeline.report.progress import Progress

from .composition import offer_plugins
from .hydra_session import hydra_started
from .jobs import JobEnd, SweepJob, ended, leave_outcome, note_end, report_end, write_page

LOGS = ".jobs"
"""Folder in a sweep's folder that holds what its jobs print."""


def run_sweep(
    sweep: Path,
    executor: Any,
    hydra_words: Sequence[str],
    folders: Sequence[str],
    job_overrides: Sequence[Sequence[str]],
    first: int,
) -> list[tuple[list[str], float | None]]:
    """Run the jobs with these overrides, numbered from `first`. Returns the own overrides and the objective of each.

    `hydra_words` are the words under `hydra.`, `folders` those of `--config-dir`.
    """
    given = {"sweep": str(sweep), "hydra": list(hydra_words), "folders": list(folders)}
    jobs = []
    for number, overrides in enumerate(job_overrides, first):
        own = {**given, "number": number, "overrides": [word for word in overrides if not is_of_executor(word)]}
        jobs.append(Job(str(number), f"{__name__}:{run_sweep_job.__name__}", own, sweep / LOGS / f"{number}.log"))
    settings: Any = OmegaConf.to_container(executor, resolve=True)
    ends: dict[str, JobEnd] = {}
    throttle = Throttle()
    with Progress(unit="jobs") as progress, WorkerPool(read_executor(settings), sweep / LOGS) as workers:
        progress.begin(sweep.name, 0, len(jobs))

        def on_end(job: Job, outcome: Outcome) -> None:
            ends[job.name] = end = _end_of(job, outcome)
            report_end(end)
            progress.update(sweep.name, len(ends), len(jobs))
            with suppress(OSError):  # a full disk: the page is written again at the end
                throttle(lambda: write_page(sweep))

        workers.run(jobs, on_end=on_end)
    page = write_page(sweep)
    for end in ends.values():
        leave_outcome(end, page)
    return [(list(job.given["overrides"]), ends[job.name].objective) for job in jobs]


def is_of_executor(word: str) -> bool:
    """Tells whether a word decides where jobs run, and not what they do."""
    return word.lstrip("+").startswith(("executor=", "executor.", "engine=", "engine."))  # engine: of older sweeps


def _end_of(job: Job, outcome: Outcome) -> JobEnd:
    if outcome.error is None:
        return JobEnd(**outcome.value)
    sweep, number = Path(job.given["sweep"]), job.name
    end = JobEnd(1, f"{outcome.error} (what it printed is in {LOGS}/{number}.log)", sweep=str(sweep), number=number)
    file = sweep / LOGS / f"{number}.folder"
    folder = Path((file.is_file() and file.read_text(encoding="utf-8")) or sweep / number)  # empty on a full disk
    return note_end(SweepJob(sweep, folder, number, tuple(job.given["overrides"])), end)


def run_sweep_job(given: Mapping[str, Any], send: Send) -> dict[str, Any]:
    """Run one job of a sweep, as a job of an executor: Hydra composes it again from its words. Returns a `JobEnd`."""
    offer_plugins()
    with hydra_started(given["folders"]) as hydra:
        words = [*given["hydra"], *given["overrides"]]
        config = hydra.config_loader.load_configuration("config", words, run_mode=RunMode.MULTIRUN)
        with open_dict(config):
            config.hydra.sweep.dir = given["sweep"]  # its time is that at which the sweep began
            config.hydra.job.id = config.hydra.job.num = given["number"]
        HydraConfig.instance().set_config(config)
        folder = Path(given["sweep"]) / str(HydraConfig.get().sweep.subdir)
        folder.mkdir(parents=True, exist_ok=True)
        with read_write(config.hydra.runtime):
            config.hydra.runtime.output_dir = str(folder)
        HydraConfig.instance().set_config(config)
        config = copy.deepcopy(config)  # what HydraConfig holds resolves within the one that was set
        with read_write(config), open_dict(config):
            del config["hydra"]
        (Path(given["sweep"]) / LOGS / f"{given['number']}.folder").write_text(str(folder), encoding="utf-8")
        return asdict(ended(config, []))

"""Hydra's launcher for the jobs of a sweep that run where `engine=…` says: `hydra/launcher=omninav`."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from hydra._internal import core_plugins
from hydra._internal.callbacks import Callbacks
from hydra.core.config_store import ConfigStore
from hydra.core.hydra_config import HydraConfig
from hydra.core.plugins import Plugins
from hydra.core.utils import JobReturn, JobStatus
from hydra.core.utils import run_job as run_by_hydra
from hydra.plugins.launcher import Launcher
from hydra.types import HydraContext, RunMode, TaskFunction
from omegaconf import DictConfig, OmegaConf, open_dict

from omninav.pipeline.graph.problems import BadInput
from omninav.pipeline.jobs.executors import read_engine
from omninav.pipeline.jobs.job import Job, Outcome, Send
from omninav.pipeline.jobs.run import Workers
from omninav.pipeline.jobs.throttle import Throttle
from omninav.pipeline.report.progress import Progress

from .hydra_session import CheckedFolder, hydra_started
from .jobs import JobEnd, SweepJob, ended, leave_outcome, note_end, report_end, write_page

NAME = "omninav"
LOGS = ".jobs"
"""Folder in a sweep's folder that holds what its jobs print."""
SCHEME = f"{CheckedFolder.scheme()}://"


class EngineLauncher(Launcher):
    """Each job of the sweep is a job of the engine; only words cross to it."""

    def __init__(self) -> None:
        self._config: Any = None
        self._folders: list[str] = []  # of --config-dir

    def setup(self, *, hydra_context: HydraContext, task_function: TaskFunction, config: DictConfig) -> None:
        """Called by Hydra before `launch`."""
        self._config = config
        paths = hydra_context.config_loader.get_search_path().get_path()
        self._folders = [str(each.path).removeprefix(SCHEME) for each in paths if each.provider == "command-line"]

    def launch(self, job_overrides: Sequence[Sequence[str]], initial_job_idx: int) -> Sequence[JobReturn]:
        """Run the jobs with these overrides."""
        sweep = Path(str(self._config.hydra.sweep.dir)).absolute()
        hydra_words = [str(word) for word in self._config.hydra.overrides.hydra]
        given = {"sweep": str(sweep), "hydra": hydra_words, "folders": self._folders}
        jobs = []
        for number, overrides in enumerate(job_overrides, initial_job_idx):
            own = {**given, "number": number, "overrides": [word for word in overrides if not is_of_engine(word)]}
            jobs.append(Job(str(number), f"{__name__}:{run_sweep_job.__name__}", own, sweep / LOGS / f"{number}.log"))
        engine: Any = OmegaConf.to_container(self._config.engine, resolve=True)
        ends: dict[str, JobEnd] = {}
        throttle = Throttle()
        with Progress(unit="jobs") as progress, Workers(read_engine(engine), sweep / LOGS) as workers:
            progress.begin(sweep.name, 0, len(jobs))

            def on_end(job: Job, outcome: Outcome) -> None:
                ends[job.name] = end = _end_of(job, outcome)
                report_end(end)
                progress.update(sweep.name, len(ends), len(jobs))
                throttle(lambda: write_page(sweep))

            workers.run(jobs, on_end=on_end)
        page = write_page(sweep)
        for end in ends.values():
            leave_outcome(end, page)
        return [_returned(job, ends[job.name]) for job in jobs]


def is_of_engine(word: str) -> bool:
    """Whether a word says where jobs run, and nothing of what they do."""
    return word.lstrip("+").startswith(("engine=", "engine."))


def _end_of(job: Job, outcome: Outcome) -> JobEnd:
    if outcome.error is None:
        return JobEnd(**outcome.value)
    sweep, number = Path(job.given["sweep"]), job.name
    end = JobEnd(1, f"{outcome.error} (what it printed is in {LOGS}/{number}.log)", sweep=str(sweep), number=number)
    file = sweep / LOGS / f"{number}.folder"
    folder = Path(file.read_text(encoding="utf-8")) if file.is_file() else sweep / number
    note_end(SweepJob(sweep, folder, number, " ".join(job.given["overrides"])), end)
    return end


def _returned(job: Job, end: JobEnd) -> JobReturn:
    result = JobReturn(overrides=list(job.given["overrides"]), status=JobStatus.COMPLETED, task_name=NAME)
    result.return_value = end.objective
    return result


def run_sweep_job(given: Mapping[str, Any], send: Send) -> dict[str, Any]:
    """Run one job of a sweep, as a job of an engine: Hydra composes it anew from its words. Returns a `JobEnd`."""
    from .composition import offer_plugins

    offer_plugins()
    ends: list[JobEnd] = []

    def task(config: Any) -> None:
        file = Path(given["sweep"]) / LOGS / f"{given['number']}.folder"
        file.write_text(HydraConfig.get().runtime.output_dir, encoding="utf-8")
        ends.append(ended(config, [], _no_experiment))

    with hydra_started(given["folders"]) as hydra:
        words = [*given["hydra"], *given["overrides"]]
        config = hydra.config_loader.load_configuration("config", words, run_mode=RunMode.MULTIRUN)
        with open_dict(config):
            config.hydra.sweep.dir = given["sweep"]  # its time is that at which the sweep began
            config.hydra.job.id = config.hydra.job.num = given["number"]
        context = HydraContext(config_loader=hydra.config_loader, callbacks=Callbacks())
        run_by_hydra(task, config, "hydra.sweep.dir", "hydra.sweep.subdir", context).return_value  # noqa: B018 - raises
    return asdict(ends[0])


def _no_experiment(config: Any, arguments: Sequence[str]) -> int:
    raise BadInput("an experiment has its own sweep: leave out -m, and write what varies into its file")


def offer_launcher() -> None:
    """Let Hydra find it among its own plugins: it looks nowhere else but in a package `hydra_plugins`."""
    setattr(core_plugins, EngineLauncher.__name__, EngineLauncher)
    EngineLauncher.__module__ = core_plugins.__name__
    Plugins.instance().register(EngineLauncher)
    target = f"{core_plugins.__name__}.{EngineLauncher.__name__}"
    ConfigStore.instance().store(NAME, {"_target_": target}, group="hydra/launcher")

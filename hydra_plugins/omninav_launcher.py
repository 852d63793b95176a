"""Hydra's launcher for the jobs of a sweep that run where `executor=…` says: `hydra/launcher=omninav`."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from hydra.core.config_store import ConfigStore
from hydra.core.utils import JobReturn, JobStatus
from hydra.plugins.launcher import Launcher
from hydra.types import HydraContext, TaskFunction
from omegaconf import DictConfig, OmegaConf

NAME = "omninav"


class OmninavLauncher(Launcher):
    """Runs each job of a sweep as a job of the executor; nothing but words crosses to it."""

    def __init__(self) -> None:
        self._config: Any = None
        self._folders: list[str] = []  # of --config-dir

    def setup(self, *, hydra_context: HydraContext, task_function: TaskFunction, config: DictConfig) -> None:
        """Called by Hydra before `launch`."""
        self._config = config
        paths = hydra_context.config_loader.get_search_path().get_path()
        self._folders = [str(each.path).partition("://")[2] for each in paths if each.provider == "command-line"]

    def launch(self, job_overrides: Sequence[Sequence[str]], initial_job_idx: int) -> Sequence[JobReturn]:
        """Run the jobs with these overrides."""
        from omninav.pipeline.cli.sweep_jobs import run_sweep  # other programs of Hydra's load this file too

        sweep = Path(str(self._config.hydra.sweep.dir)).absolute()
        words: Any = OmegaConf.to_container(self._config.hydra.overrides.hydra, resolve=False)  # each job's are its own
        ended = run_sweep(sweep, self._config.executor, words, self._folders, job_overrides, initial_job_idx)
        return [_returned(overrides, objective) for overrides, objective in ended]


def _returned(overrides: Sequence[str], objective: float | None) -> JobReturn:
    result = JobReturn(overrides=list(overrides), status=JobStatus.COMPLETED, task_name=NAME)
    result.return_value = objective
    return result


ConfigStore.instance().store(
    NAME, {"_target_": f"{__name__}.{OmninavLauncher.__name__}"}, group="hydra/launcher", provider=NAME
)

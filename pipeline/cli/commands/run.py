"""`omninav variant=… log=…`, `omninav -m …`, `omninav +experiment=…`: hand over to Hydra, which calls each job."""

import itertools
import os
import sys
import tempfile
from argparse import Namespace
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from hydra.errors import HydraException
from hydra.types import RunMode
from omegaconf import OmegaConf

from omninav.pipeline.cli.arguments import condition_arguments, flags_parser, read_flags, value_text
from omninav.pipeline.cli.composition import offer_plugins
from omninav.pipeline.cli.composition_cache import CONFIG, RUN_ALONE
from omninav.pipeline.cli.hydra_session import hydra_started
from omninav.pipeline.cli.jobs import OUTCOMES, run_job, show_sweep
from omninav.pipeline.cli.overrides import composed_of, invalid_overrides, jobs_to_try, with_unlisted_parameters
from omninav.pipeline.cli.sweep_jobs import is_of_executor
from omninav.pipeline.cli.terminal import shown
from omninav.pipeline.files import Taken, locked
from omninav.pipeline.graph.problems import BadInput, ProblemsFound, one_line
from omninav.pipeline.graph.small_files import read_yaml
from omninav.pipeline.run.prepared_run import Prepare, prepare_run
from omninav.pipeline.run.run_folder import new_folder

LAUNCHER = "hydra/launcher=omninav"
"""Word that sends the jobs of a sweep to the executor that was typed."""

SWEEPING = ("hydra.sweeper", "hydra.launcher", "hydra/sweeper", "hydra/launcher")
"""Beginnings of the words that choose and set who runs a sweep."""
OPTIMISERS = ("optuna", "ax", "nevergrad")
"""Hydra's sweepers that optimise, and leave `optimization_results.yaml`."""


def command(
    arguments: list[str],
    prepare: Prepare = prepare_run,
    on_sweep: Callable[[Path], None] = lambda folder: None,
) -> int:
    """Run one job, or all of a sweep. Hydra composes the configurations, and `prepare` checks each run.

    `on_sweep` gets the folder of a sweep before its first job.
    """
    flags = read_flags(arguments)
    words, folders = flags.overrides, [flags.config_dir] if flags.config_dir else []
    offer_plugins()  # which parameters there are depends on the stages that are offered
    with hydra_started(folders) as hydra:
        listed = with_unlisted_parameters(words, folders)
        arguments = [listed[words.index(word)] if word in words else word for word in arguments]
        if flags.multirun:
            for tried in jobs_to_try(listed, folders):  # Hydra makes a sweep's folder before it reads the words
                composed_of(tried, folders)
            if any(map(is_of_executor, listed)) and not any(word.startswith("hydra/launcher") for word in listed):
                listed, arguments = [*listed, LAUNCHER], [*arguments, LAUNCHER]

        def job(config: Any) -> float | None:
            return run_job(config, arguments, prepare)

        of_conditions = condition_arguments(listed)
        typed = [word for word in listed if word not in of_conditions]
        sys.argv = ["omninav", *(word for word in arguments if word not in of_conditions)]
        try:
            return _handed_over(hydra, flags, typed, job, on_sweep)
        except HydraException as error:
            raise ProblemsFound(invalid_overrides(listed, folders, str(error))) from None


def _handed_over(
    hydra: Any,
    flags: Namespace,
    words: list[str],
    job: Callable[[Any], float | None],
    on_sweep: Callable[[Path], None],
) -> int:
    """Does what the flags ask Hydra for: a job, a sweep, or something to print. The worst exit code of the jobs."""
    if flags.hydra_help:
        hydra.hydra_help(CONFIG, flags_parser(), flags)
    elif flags.cfg:
        hydra.show_cfg(CONFIG, words, flags.cfg, flags.package, flags.resolve)
    elif flags.info:
        hydra.show_info(flags.info, CONFIG, words)
    else:
        with tempfile.TemporaryDirectory() as place:
            outcomes = Path(place) / "outcomes"
            os.environ[OUTCOMES] = str(outcomes)
            if flags.multirun:
                with _own_folder(hydra, words) as (folder, words_of_folder):
                    on_sweep(folder)
                    _sweep(hydra, job, [*words, *words_of_folder], outcomes)
            else:
                hydra.run(CONFIG, job, [*words, RUN_ALONE])
            ends = _ends(outcomes)
        for page in {page for _, _, page in ends if page}:
            show_sweep(Path(page).parent)
            optimum = Path(page).parent / "optimization_results.yaml"
            if optimum.is_file():
                print(f"optimum: {shown(optimum)}\n{optimum.read_text(encoding='utf-8').strip()}", flush=True)
        return max((int(code) for code, _, _ in ends), default=0)
    return 0


def _sweep(hydra: Any, job: Callable[[Any], float | None], words: Sequence[str], outcomes: Path) -> None:
    """Run a sweep. An optimiser that gives up because every job has failed is no error of its own."""
    try:
        hydra.multirun(CONFIG, job, [*words, "hydra.mode=MULTIRUN"])
    except HydraException:
        raise
    except Exception as error:
        ends = _ends(outcomes)
        typed = [word for word in words if word.startswith(SWEEPING) and word != LAUNCHER]
        if not ends and typed and not isinstance(error, ProblemsFound | BadInput):
            what = one_line(f"{type(error).__name__}: {error}")
            raise BadInput(f"the sweep cannot begin: {what}; change {' '.join(typed)}") from error
        if not ends or any(code == "0" for code, _, _ in ends):
            raise
        print("every job failed: there is no best one", file=sys.stderr, flush=True)


def _ends(outcomes: Path) -> list[tuple[str, str, str]]:
    """The exit code of each job, and its sweep's page."""
    lines = outcomes.read_text(encoding="utf-8").splitlines() if outcomes.exists() else []
    return [line.partition(" ") for line in lines]


@contextmanager
def _own_folder(hydra: Any, words: Sequence[str]) -> Iterator[tuple[Path, list[str]]]:
    """Keep other sweeps out of a sweep's folder while the block runs. Gives the folder, and words that set it.

    A folder that is named by the second is a new one. Raises `BadInput` where another sweep is in it.
    """
    config = hydra.compose_config(CONFIG, [*words], RunMode.MULTIRUN)
    _refuse_unfit_sweeper(config)
    place = config.hydra.sweep
    folder = Path(str(place.dir))
    words_of_folder: list[str] = []
    as_written: Any = OmegaConf.to_container(place, resolve=False)
    if "%S" in str(as_written["dir"]):  # another one may begin in the same second
        folder = new_folder(folder)
        words_of_folder = [f"hydra.sweep.dir={value_text(folder)}"]
    try:
        with locked(folder / ".sweep.lock", wait=False):
            _refuse_other_sweep(folder, words)
            yield folder, words_of_folder
    except Taken as taken:
        raise BadInput(
            f"{folder}: {taken} runs a sweep in it; wait until it has ended, or name another: hydra.sweep.dir=…"
        ) from None


def _refuse_unfit_sweeper(config: Any) -> None:
    """Raise `BadInput` where Hydra's sweepers that optimise would find out at the end that they cannot."""
    chosen = config.hydra.runtime.choices["hydra/sweeper"]
    if chosen in OPTIMISERS and not config.get("objective"):
        raise BadInput(f"hydra/sweeper={chosen}: nothing says what it optimises; type objective=NAME of metrics.json")
    for name in ("n_jobs", "n_trials"):
        if config.hydra.sweeper.get(name) == 0:
            raise BadInput(f"hydra.sweeper.{name}: 0, expected a whole number >= 1")


def _refuse_other_sweep(folder: Path, words: Sequence[str]) -> None:
    """A sweep that was stopped continues when it is typed again; another one does not take its folder."""
    file = folder / "multirun.yaml"
    if not file.is_file():
        return
    settings = read_yaml(file)
    before = [str(word) for word in OmegaConf.select(OmegaConf.create(settings), "hydra.overrides.task") or ()]
    given = [word for word in words if not word.startswith(("hydra.", "hydra/"))]
    if sorted(itertools.filterfalse(is_of_executor, before)) != sorted(itertools.filterfalse(is_of_executor, given)):
        raise BadInput(f"{folder}: another sweep is in it ({' '.join(before):.200}); name another: hydra.sweep.dir=…")

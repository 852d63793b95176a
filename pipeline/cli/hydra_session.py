"""Hydra as omninav starts it: it composes configurations and launches jobs, and calls nothing else that they name."""

import os
import pickle
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import lru_cache
from importlib.resources import files
from pathlib import Path
from typing import Any

from hydra import initialize, version
from hydra.core.config_loader import ConfigLoader
from hydra.core.config_search_path import ConfigSearchPath
from hydra.core.config_store import ConfigStore
from hydra.core.global_hydra import GlobalHydra
from hydra.core.plugins import Plugins
from hydra.plugins.search_path_plugin import SearchPathPlugin
from hydra.types import RunMode
from omegaconf import MISSING, OmegaConf, open_dict
from omegaconf.errors import OmegaConfBaseException

from hydra_plugins.omninav_launcher import OmninavLauncher
from omninav.pipeline.graph.problems import BadInput, Problem, ProblemsFound, shown
from omninav.pipeline.graph.registry import Entry, plugins

from .artifact_graph import learned, words_of_artifact, words_of_variant
from .composition_cache import CONFIG, RUN_ALONE, from_options, hydra_errors, parsed
from .config_groups import CONF
from .config_sources import CheckedFolder, OwnFiles
from .interpolations import interpolations_limited

VERSION_BASE = "1.3"
"""Version of Hydra whose defaults hold."""
FOLDERS_OF_JOBS = ("run", "sweep")
LAUNCHING = ("launcher", "sweeper")
"""Parts of `hydra.` whose classes are called, with parameters: those that installed packages registered."""
FILLED_IN = ("mode", "overrides", "runtime")
"""Parts of `hydra.` that Hydra fills in itself."""
FILLED_IN_OF_JOB = ("name", "override_dirname", "id", "num", "config_name")
"""Parts of `hydra.job.` that Hydra fills in itself."""
OWN_WORDS = ("hydra/job_logging=disabled", "hydra/hydra_logging=disabled", "hydra.output_subdir=null")
"""Values that config.yaml gives to those parts that a configuration cannot set."""
CALLED_BY_NAME = ("custom_search_space",)
"""Parameters of a sweeper that name a function to call."""
ALONE = threading.RLock()
"""Held while Hydra composes, and during a sweep."""
MAX_KEPT = 256
"""Configurations of options that a process keeps, each of some 100 kB."""


@contextmanager
def hydra_started(folders: Sequence[str] = ()) -> Iterator[Any]:
    """Hydra, which finds configurations among omninav's own and in `folders` (of `--config-dir`).

    Hydra is one for the whole process: threads wait for each other.
    """
    session = GlobalHydra.instance()
    with ALONE:
        before, session.hydra = session.hydra, None
        version.setbase(VERSION_BASE)
        session.hydra = _finding_in(tuple(folders)) if folders else _finding_own(tuple(plugins()))
        try:
            with interpolations_limited(), interrupts_kept():
                yield session.hydra
        finally:
            session.hydra = before


@contextmanager
def interrupts_kept() -> Iterator[None]:
    """Raise KeyboardInterrupt again where OmegaConf, putting flags back after one, has raised an error in its place."""
    try:
        yield
    except Exception as error:
        before: BaseException | None = error
        while before is not None and not isinstance(before, KeyboardInterrupt):
            before = before.__context__
        if before is None:
            raise
        raise KeyboardInterrupt from None


@lru_cache(maxsize=4)
def _finding_own(offered: tuple[Entry, ...]) -> Any:
    """Hydra without other folders: what it has read and composed serves all commands of a process.

    Only third parties' stages may be `offered` meanwhile; omninav's own files stay as they are.
    """
    return _finding_in(())


def _finding_in(folders: Sequence[str]) -> Any:
    _refuse_hidden(folders)
    for plugin in (OwnFiles, CheckedFolder, _SearchPath, OmninavLauncher):
        Plugins.instance().register(plugin)
    _SearchPath.folders = [str(Path(folder).absolute()) for folder in folders]
    try:
        initialize(config_path=None, job_name="omninav", version_base=VERSION_BASE)
    finally:
        _SearchPath.folders = None
    started: Any = GlobalHydra.instance().hydra
    started.config_loader = CheckedLoader(started.config_loader)
    return started


def _refuse_hidden(folders: Sequence[str]) -> None:
    """Raise `BadInput` for an option in `folders` that omninav has too, whose file Hydra would read in its place."""
    own = Path(str(files(CONF)))
    for option in sorted(own.glob("*/**/*.yaml")) if folders else ():
        for folder in folders:
            file = Path(folder) / option.relative_to(own)
            if file.is_file() and not file.samefile(option):
                raise BadInput(f"{file}: omninav has a file of this name, and would read its own; rename yours")


class _SearchPath(SearchPathPlugin):
    """Adds omninav's configurations and those of `--config-dir`, before the schemas that Hydra adds last."""

    folders: Sequence[str] | None = None
    """Folders of `--config-dir` while omninav starts Hydra; None: another program starts it, with its own files."""

    def manipulate_search_path(self, search_path: ConfigSearchPath) -> None:
        """Called by Hydra when it starts."""
        if self.folders is None:
            return
        search_path.append("main", f"{OwnFiles.scheme()}://{CONF}")
        for folder in self.folders:
            search_path.append("command-line", f"{CheckedFolder.scheme()}://{folder}")


class CheckedLoader:
    """Hydra's loader, which refuses every key under `hydra.` beyond folders of jobs, launcher and sweeper."""

    def __init__(self, hydras: ConfigLoader) -> None:
        self._hydras = hydras
        self.get_search_path, self.get_sources = hydras.get_search_path, hydras.get_sources
        self.list_groups, self.get_group_options = hydras.list_groups, hydras.get_group_options
        self.compute_defaults_list = hydras.compute_defaults_list
        self._kept: dict[tuple[str, ...], bytes] = {}
        self._own: Any = None

    def load_configuration(self, config_name: str | None, overrides: list[str], *args: Any, **kwargs: Any) -> Any:
        """A composed configuration. Raises `ProblemsFound`, or Hydra's own errors."""
        _refuse_search_path(overrides)
        with hydra_errors():
            words, variant = self._of_artifact(overrides)
            if config_name == CONFIG and RUN_ALONE in words:
                config = self._of_job(words)
            else:
                config = self._hydras.load_configuration(config_name, words, *args, **kwargs)
            _name(config, variant, overrides)
        if config_name is not None and overrides:
            self._refuse_foreign(config)
        return config

    def load_sweep_config(self, master_config: Any, sweep_overrides: list[str]) -> Any:
        """The configuration of a sweep's job. Raises as `load_configuration`."""
        _refuse_search_path(sweep_overrides)
        with hydra_errors():
            words, variant = self._of_artifact(sweep_overrides)
            hydras: Any = OmegaConf.to_container(master_config.hydra.overrides.hydra, resolve=False)
            config = self._of_job([*hydras, *words])
            OmegaConf.copy_cache(from_config=master_config, to_config=config)
            _name(config, variant, sweep_overrides)
        self._refuse_foreign(config)
        return config

    def _of_job(self, words: Sequence[str]) -> Any:
        """Composes the configuration of one job as Hydra does.

        It loads what options give once, so that files edited meanwhile count from the next start on.
        """

        def kept(options: tuple[str, ...]) -> bytes:
            if options not in self._kept:
                if len(self._kept) >= MAX_KEPT:
                    self._kept.pop(next(iter(self._kept)))
                loaded = self._hydras.load_configuration(CONFIG, [*options], RunMode.RUN, from_shell=False)
                self._kept[options] = pickle.dumps(loaded)
            return self._kept[options]

        given = parsed(words)
        config = from_options(kept, given)
        of_job, own = config.hydra.job, [word for word in given if not word.is_hydra_override()]
        config.hydra.overrides.task = [word.input_line for word in own]
        config.hydra.runtime.cwd = os.getcwd()
        form = of_job.config.override_dirname
        named = sorted(str(word.input_line) for word in own if word.key_or_group not in form.exclude_keys)
        of_job.override_dirname = form.item_sep.join(named).replace("=", form.kv_sep)
        return config

    def _of_artifact(self, words: list[str]) -> tuple[list[str], str]:
        """The words that describe the graph of the artifact that is asked for, and its name; else the words, and ''."""
        name = learned(words)
        if name is None:
            return words, ""
        variant = self._of_job([*words_of_variant(words, self.list_groups("")), RUN_ALONE])
        return words_of_artifact(name, variant, words), f"{variant.variant}_{name}"

    def _refuse_foreign(self, config: Any) -> None:
        if self._own is None:
            self._own = self._hydras.load_configuration(None, [*OWN_WORDS], RunMode.RUN).hydra
        problems = list(_foreign(config.hydra, self._own))
        if problems:
            raise ProblemsFound(dict.fromkeys(problems))


def _name(config: Any, variant: str, words: Sequence[str]) -> None:
    """Name the graph of an artifact by its variant, and keep the words that were typed."""
    if variant:
        config.variant = variant
        with open_dict(config.hydra):
            config.hydra.overrides.task = [word for word in words if not word.lstrip("+~").startswith("hydra")]


def _refuse_search_path(overrides: Sequence[str]) -> None:
    if any(word.lstrip("+~").startswith("hydra.searchpath") for word in overrides):
        raise ProblemsFound([not_settable("hydra.searchpath")])  # Hydra imports a package that it names


def _foreign(given: Any, own: Any) -> Iterator[Problem]:
    """Problems of overrides under `hydra.` that are neither omninav's `own` nor of its flags."""
    free = (*FOLDERS_OF_JOBS, *LAUNCHING, *FILLED_IN)
    theirs, ours = (_plain(config) for config in (given, own))
    for key in sorted({*theirs, *ours} - {*free}):
        if theirs.get(key) != ours.get(key):
            yield not_settable(f"hydra.{key}")
    for key in LAUNCHING:
        for resolve in (False, True):
            try:
                part = OmegaConf.to_container(given[key], resolve=resolve) if OmegaConf.is_config(given[key]) else None
            except OmegaConfBaseException as error:
                yield Problem(f"hydra.{key}", str(error).split("\n")[0])
                continue
            yield from _foreign_classes(part, f"hydra.{key}")


def _plain(config: Any) -> dict[str, Any]:
    """The parts that are there, without what Hydra fills in for a job."""
    plain: Any = OmegaConf.to_container(config, resolve=False)
    if isinstance(plain.get("job"), dict):
        plain["job"] = {name: part for name, part in plain["job"].items() if name not in FILLED_IN_OF_JOB}
    return {str(key): None if part == MISSING else part for key, part in plain.items()}


def not_settable(where: str) -> Problem:
    """Problem to report of a name under `hydra.`."""
    return Problem(where, "a configuration cannot set this", f"under hydra. one can set: {', '.join(HYDRA_KEYS)}")


HYDRA_KEYS = ("hydra.run.dir", "hydra.sweep.dir", "hydra.sweep.subdir", "hydra/launcher", "hydra/sweeper")


def _foreign_classes(part: Any, where: str) -> Iterator[Problem]:
    """Classes in a launcher or a sweeper that no installed package has registered, and functions called by name."""
    for path, name, value in _entries(part, where):
        if name == "_target_" and (not isinstance(value, str) or value not in _registered()):
            yield Problem(path, f"{shown(value)} is no launcher or sweeper of an installed package")
        elif name in CALLED_BY_NAME and value is not None:
            yield not_settable(path)


def _registered() -> set[str]:
    """The classes that installed packages have registered for `hydra/launcher`, `hydra/sweeper` and parts of them."""
    found: set[str] = set()
    waiting: list[Any] = [ConfigStore.instance().repo.get("hydra", {}).get(key, {}) for key in LAUNCHING]
    while waiting:
        for value in waiting.pop().values():
            if isinstance(value, dict):
                waiting.append(value)
            else:
                node = OmegaConf.to_container(value.node, resolve=False)
                found |= {str(target) for _, name, target in _entries(node, "") if name == "_target_"}
    return found


def _entries(part: Any, where: str) -> Iterator[tuple[str, Any, Any]]:
    """Path, name and value of all that mappings and lists hold, those within each other too."""
    for name, value in part.items() if isinstance(part, dict) else enumerate(part) if isinstance(part, list) else ():
        yield f"{where}.{name}", name, value
        yield from _entries(value, f"{where}.{name}")

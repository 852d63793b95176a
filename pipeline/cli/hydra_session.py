"""Hydra as omninav starts it: it composes configurations and launches jobs, and calls nothing else that they name."""

import os
import pickle
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import lru_cache
from pathlib import Path, PurePosixPath
from typing import Any

import yaml
from hydra import version
from hydra._internal.config_loader_impl import ConfigLoaderImpl
from hydra._internal.core_plugins.file_config_source import FileConfigSource
from hydra._internal.core_plugins.importlib_resources_config_source import ImportlibResourcesConfigSource
from hydra._internal.hydra import Hydra
from hydra._internal.sources_registry import SourcesRegistry
from hydra._internal.utils import create_config_search_path
from hydra.core.config_search_path import SearchPathQuery
from hydra.core.config_store import ConfigStore
from hydra.core.global_hydra import GlobalHydra
from hydra.core.object_type import ObjectType
from hydra.errors import ConfigCompositionException, HydraException
from hydra.plugins.config_source import ConfigLoadError, ConfigResult, ConfigSource
from omegaconf import OmegaConf
from omegaconf._utils import get_yaml_loader
from omegaconf.errors import OmegaConfBaseException

from omninav.pipeline.graph.problems import BadInput, Problem, ProblemsFound, shown
from omninav.pipeline.graph.registry import Entry, plugins
from omninav.pipeline.graph.small_files import read_yaml

from .config_groups import CONF, listed_groups, stage_option, stage_options
from .interpolations import interpolations_limited

FOLDERS_OF_JOBS = ("run", "sweep")
LAUNCHING = ("launcher", "sweeper")
"""Parts of `hydra.` whose classes are called, with parameters: those that installed packages registered."""
OF_HYDRA = ("mode", "overrides", "runtime")
"""Parts of `hydra.` that Hydra fills in itself."""
OF_A_JOB = ("name", "override_dirname", "id", "num", "config_name")
"""Parts of `hydra.job.` that Hydra fills in itself."""
OWN_WORDS = ("hydra/job_logging=disabled", "hydra/hydra_logging=disabled", "hydra.output_subdir=null")
"""Values that config.yaml gives to those parts that a configuration cannot set."""
CALLED_BY_NAME = ("custom_search_space",)
"""Parameters of a sweeper that name a function to call."""


@contextmanager
def hydra_started(folders: Sequence[str] = ()) -> Iterator[Hydra]:
    """Hydra, which finds configurations among omninav's own and in `folders` (of `--config-dir`)."""
    from .launcher import offer_launcher

    offer_launcher()
    session, version_base = GlobalHydra.instance(), "1.3"
    before, session.hydra = session.hydra, None
    version.setbase(version_base)
    session.hydra = _finding_in(folders) if folders else _finding_own(tuple(plugins()))
    try:
        with interpolations_limited():
            yield session.hydra
    finally:
        session.hydra = before


@lru_cache(maxsize=4)
def _finding_own(offered: tuple[Entry, ...]) -> Hydra:
    """Hydra without other folders: what it has read and composed serves all commands of a process.

    Only third parties' stages may be `offered` meanwhile; omninav's own files stay as they are.
    """
    return _finding_in(())


def _finding_in(folders: Sequence[str]) -> Hydra:
    search_path = create_config_search_path(f"{OwnFiles.scheme()}://{CONF}")
    SourcesRegistry.instance().register(CheckedFolder)
    SourcesRegistry.instance().register(OwnFiles)
    for folder in folders:
        place = f"{CheckedFolder.scheme()}://{Path(folder).absolute()}"
        search_path.prepend("command-line", place, SearchPathQuery(provider="schema"))
    return Hydra(task_name="omninav", config_loader=CheckedLoader(search_path))


class OwnFiles(ImportlibResourcesConfigSource):
    """omninav's own configurations, each of which a process parses once, and the stages that are options by name."""

    @staticmethod
    def scheme() -> str:
        """What stands before its path."""
        return "own"

    def load_config(self, config_path: str) -> ConfigResult:
        """A file's content, or a node with the stage that an option is named after."""
        if super().is_config(config_path):
            return super().load_config(config_path)
        target = _stage_of(config_path)
        if target is None:
            raise ConfigLoadError(f"Config not found : {config_path}")
        header: dict[str, str | None] = {"package": f"nodes.{PurePosixPath(config_path).parent}"}
        return ConfigResult(
            self.provider, f"{self.scheme()}://{self.path}", OmegaConf.create({"_target_": target}), header
        )

    def is_config(self, config_path: str) -> bool:
        """Tells whether an option is a file, or a stage's name."""
        return super().is_config(config_path) or _stage_of(config_path) is not None

    def is_group(self, config_path: str) -> bool:
        """Tells whether a path is a folder, or the name of a group whose options are stages alone."""
        return super().is_group(config_path) or config_path in listed_groups()

    def list(self, config_path: str, results_filter: ObjectType | None) -> list[str]:
        """The options of a group, those within folders of it apart."""
        found = super().list(config_path, results_filter) if super().is_group(config_path) else []
        if config_path == "":
            named = [*listed_groups()] if results_filter in (None, ObjectType.GROUP) else []
        else:
            named = stage_options(config_path) if results_filter in (None, ObjectType.CONFIG) else []
        return sorted({*found, *named})

    def _read_config(self, res: Any) -> ConfigResult:
        text = res.read_text(encoding="utf-8")
        header = ConfigSource._get_header_dict(text[:512])
        return ConfigResult(self.provider, f"{self.scheme()}://{self.path}", pickle.loads(_parsed(text)), header)


def _stage_of(config_path: str) -> str | None:
    group, _, name = config_path.removesuffix(".yaml").partition("/")
    return stage_option(group, name)


class _YamlLoader(yaml.CSafeLoader):
    """Reads as OmegaConf does, ten times as fast."""

    yaml_implicit_resolvers = get_yaml_loader().yaml_implicit_resolvers


@lru_cache(maxsize=512)
def _parsed(text: str) -> bytes:
    # A configuration is read from its bytes five times as fast as it is made of plain values.
    return pickle.dumps(OmegaConf.create(yaml.load(text, _YamlLoader) or {}))


class CheckedFolder(FileConfigSource):
    """A folder of configurations, whose files are read within limits."""

    @staticmethod
    def scheme() -> str:
        """What stands before its path."""
        return "checked"

    def load_config(self, config_path: str) -> ConfigResult:
        """A file's content. Raises `BadInput`."""
        file = Path(self.path) / self._normalize_file_name(config_path)
        if os.path.lexists(file):
            content = read_yaml(file)
            if content is not None and not isinstance(content, dict):
                raise BadInput(f"{file}: {shown(content)}, expected names and their values (name: value)")
        return super().load_config(config_path)

    def list(self, config_path: str, results_filter: ObjectType | None) -> list[str]:
        """Names of files and folders in a folder; a link to a folder is not listed: it may lead back here."""
        folder, names = Path(self.path, config_path), super().list(config_path, results_filter)
        return [name for name in names if not ((folder / name).is_symlink() and (folder / name).is_dir())]


@contextmanager
def hydra_errors() -> Iterator[None]:
    """Whatever Hydra stumbles over is an error of Hydra's."""
    try:
        yield
    except (HydraException, OmegaConfBaseException, BadInput):
        raise
    except (
        ValueError,
        LookupError,
        TypeError,
        AttributeError,
        ArithmeticError,
        RecursionError,
        AssertionError,
    ) as error:
        raise ConfigCompositionException(f"{type(error).__name__}: {error}") from None


class CheckedLoader(ConfigLoaderImpl):
    """Refuses whatever stands under `hydra.` beyond the folders of jobs, launcher and sweeper, whoever composes it."""

    _own: Any = None

    def load_configuration(self, config_name: str | None, overrides: list[str], *args: Any, **kwargs: Any) -> Any:
        """A composed configuration. Raises `ProblemsFound`, or Hydra's own errors."""
        if any(word.lstrip("+~").startswith("hydra.searchpath") for word in overrides):
            raise ProblemsFound([not_settable("hydra.searchpath")])  # Hydra imports a package that it names
        with hydra_errors():
            config = super().load_configuration(config_name, overrides, *args, **kwargs)
        if overrides and config_name is not None:
            if self._own is None:
                self._own = super().load_configuration(None, [*OWN_WORDS], *args, **kwargs).hydra
            problems = list(_foreign(config.hydra, self._own))
            if problems:
                raise ProblemsFound(dict.fromkeys(problems))
        return config


def _foreign(given: Any, own: Any) -> Iterator[Problem]:
    """What stands under `hydra.` and is neither omninav's `own` nor of its flags."""
    free = (*FOLDERS_OF_JOBS, *LAUNCHING, *OF_HYDRA)
    for key in sorted({*map(str, given), *map(str, own)} - {*free}):
        skip = OF_A_JOB if key == "job" else ()
        if _plain(given, key, skip) != _plain(own, key, skip):
            yield not_settable(f"hydra.{key}")
    for key in LAUNCHING:
        for resolve in (False, True):
            try:
                part = OmegaConf.to_container(given[key], resolve=resolve) if OmegaConf.is_config(given[key]) else None
            except OmegaConfBaseException as error:
                yield Problem(f"hydra.{key}", str(error).split("\n")[0])
                continue
            if part is None and OmegaConf.is_missing(given, key):
                continue
            yield from _foreign_classes(part, f"hydra.{key}")


def _plain(config: Any, key: str, skip: Sequence[str]) -> Any:
    if key not in config or OmegaConf.is_missing(config, key):
        return None
    value = config._get_node(key)
    if not OmegaConf.is_dict(value):
        return OmegaConf.to_container(value, resolve=False) if OmegaConf.is_config(value) else value._value()
    plain: Any = OmegaConf.to_container(value, resolve=False)
    return {name: part for name, part in plain.items() if name not in skip} if isinstance(plain, dict) else plain


def not_settable(where: str) -> Problem:
    """What to say of a name under `hydra.`."""
    return Problem(where, "a configuration cannot set this", f"under hydra. one can set: {', '.join(SETTABLE)}")


SETTABLE = ("hydra.run.dir", "hydra.sweep.dir", "hydra.sweep.subdir", "hydra/launcher", "hydra/sweeper")


def _foreign_classes(part: Any, where: str) -> Iterator[Problem]:
    """Classes in a launcher or a sweeper that no installed package has registered, and functions called by name."""
    for name, value in part.items() if isinstance(part, dict) else enumerate(part) if isinstance(part, list) else ():
        path = f"{where}.{name}"
        if name == "_target_":
            if not isinstance(value, str) or value not in _registered():
                yield Problem(path, f"{shown(value)} is no launcher or sweeper of an installed package")
        elif name in CALLED_BY_NAME and value is not None:
            yield not_settable(path)
        else:
            yield from _foreign_classes(value, path)


def _registered() -> set[str]:
    """The classes that installed packages have registered for `hydra/launcher`, `hydra/sweeper` and parts of them."""
    found: set[str] = set()
    waiting: list[Any] = [ConfigStore.instance().repo.get("hydra", {}).get(key, {}) for key in LAUNCHING]
    while waiting:
        for value in waiting.pop().values():
            if isinstance(value, dict):
                waiting.append(value)
            else:
                found |= set(_targets(OmegaConf.to_container(value.node, resolve=False)))
    return found


def _targets(part: Any) -> Iterator[str]:
    for name, value in part.items() if isinstance(part, dict) else enumerate(part) if isinstance(part, list) else ():
        if name == "_target_":
            yield str(value)
        else:
            yield from _targets(value)

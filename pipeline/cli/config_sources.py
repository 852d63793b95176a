"""Hydra's sources of configurations: omninav's own files and stages, and the folders of `--config-dir`."""

import os
import pickle
from abc import abstractmethod
from functools import lru_cache
from importlib.resources import files
from importlib.resources.abc import Traversable
from pathlib import Path, PurePosixPath
from typing import Any

import yaml
from hydra.core.object_type import ObjectType
from hydra.plugins.config_source import ConfigLoadError, ConfigResult, ConfigSource
from omegaconf import OmegaConf
from omegaconf._utils import get_yaml_loader  # the rules by which OmegaConf tells numbers from texts

from omninav.pipeline.graph.problems import BadInput, shown
from omninav.pipeline.graph.small_files import read_yaml

from .config_groups import CONF, listed_groups, listed_option, listed_options


class _Files(ConfigSource):
    """Files of YAML in folders that are groups."""

    @property
    @abstractmethod
    def _root(self) -> Traversable: ...

    def available(self) -> bool:
        """Tells whether there is such a folder."""
        return self._root.is_dir()

    def is_group(self, config_path: str) -> bool:
        """Tells whether a path is a folder."""
        return self._root.joinpath(config_path).is_dir()

    def is_config(self, config_path: str) -> bool:
        """Tells whether a path, with or without its ending, is a file."""
        return self._file(config_path).is_file()

    def load_config(self, config_path: str) -> ConfigResult:
        """A file's content, which a process parses once. Raises `ConfigLoadError` where there is none."""
        file = self._file(config_path)
        if not file.is_file():
            raise ConfigLoadError(f"Config not found : {file}")
        text = file.read_text(encoding="utf-8")
        return self._result(pickle.loads(_parsed(text)), self._get_header_dict(text[:512]))

    def list(self, config_path: str, results_filter: ObjectType | None) -> list[str]:
        """Names of the groups and configurations in a folder."""
        found = set()
        for entry in self._root.joinpath(config_path).iterdir():
            if entry.is_dir() and entry.name != "__pycache__" and results_filter in (None, ObjectType.GROUP):
                found.add(entry.name)
            if entry.name.endswith(".yaml") and entry.is_file() and results_filter in (None, ObjectType.CONFIG):
                found.add(entry.name.removesuffix(".yaml"))
        return sorted(found)

    def _file(self, config_path: str) -> Traversable:
        return self._root.joinpath(self._normalize_file_name(config_path))

    def _result(self, content: Any, header: dict[str, str | None]) -> ConfigResult:
        return ConfigResult(self.provider, self.full_path(), content, header)


class OwnFiles(_Files):
    """omninav's own configurations, and the options that have no file."""

    @staticmethod
    def scheme() -> str:
        """Returns the prefix of its paths."""
        return "own"

    @property
    def _root(self) -> Traversable:
        return files(CONF)

    def load_config(self, config_path: str) -> ConfigResult:
        """A file's content, or that of an option without a file."""
        listed = None if super().is_config(config_path) else _listed(config_path)
        if listed is None:
            return super().load_config(config_path)
        package = f"nodes.{PurePosixPath(config_path).parent}" if "_target_" in listed else "_global_"
        return self._result(OmegaConf.create(listed), {"package": package})

    def is_config(self, config_path: str) -> bool:
        """Tells whether an option has a file, or is listed without one."""
        return super().is_config(config_path) or _listed(config_path) is not None

    def is_group(self, config_path: str) -> bool:
        """Tells whether a path is a folder, or the name of a group whose options have no files."""
        return super().is_group(config_path) or config_path in listed_groups()

    def list(self, config_path: str, results_filter: ObjectType | None) -> list[str]:
        """The options of a group, those within folders of it apart."""
        found = super().list(config_path, results_filter) if super().is_group(config_path) else []
        if config_path == "":
            named = [*listed_groups()] if results_filter in (None, ObjectType.GROUP) else []
        else:
            named = listed_options(config_path) if results_filter in (None, ObjectType.CONFIG) else []
        return sorted({*found, *named})


class CheckedFolder(_Files):
    """A folder of configurations, whose files are read within limits."""

    @staticmethod
    def scheme() -> str:
        """Returns the prefix of its paths."""
        return "checked"

    @property
    def _root(self) -> Path:
        return Path(self.path)

    def load_config(self, config_path: str) -> ConfigResult:
        """A file's content. Raises `BadInput`."""
        file = Path(str(self._file(config_path)))
        if os.path.lexists(file):
            content = read_yaml(file)
            if content is not None and not isinstance(content, dict):
                raise BadInput(f"{file}: {shown(content)}, expected names and their values (name: value)")
        return super().load_config(config_path)

    def list(self, config_path: str, results_filter: ObjectType | None) -> list[str]:
        """Names of files and folders in a folder; a link to a folder is not listed: it may lead back here."""
        folder, names = Path(self.path, config_path), super().list(config_path, results_filter)
        return [name for name in names if not ((folder / name).is_symlink() and (folder / name).is_dir())]


def _listed(config_path: str) -> dict[str, Any] | None:
    group, _, name = config_path.removesuffix(".yaml").partition("/")
    return listed_option(group, name)


class _YamlLoader(yaml.CSafeLoader):
    """Reads as OmegaConf does, ten times as fast."""

    yaml_implicit_resolvers = get_yaml_loader().yaml_implicit_resolvers


@lru_cache(maxsize=512)
def _parsed(text: str) -> bytes:
    # A configuration is read from its bytes five times as fast as it is made of plain values.
    return pickle.dumps(OmegaConf.create(yaml.load(text, _YamlLoader) or {}))

"""The groups of configuration that omninav brings: which option puts which stage into a graph."""

import functools
from importlib.resources import files
from importlib.resources.abc import Traversable

from omninav.pipeline.graph.registry import Entry

CONF = "omninav.conf"


def group_files(group: str) -> list[Traversable]:
    """The option files of a group, by name; none where there is no such group."""
    folder = files(CONF).joinpath(group)
    found = [file for file in folder.iterdir() if file.name.endswith(".yaml")] if folder.is_dir() else []
    return sorted(found, key=lambda file: file.name)


def is_group(name: str) -> bool:
    """Whether configuration has a group of that name."""
    return bool(name) and files(CONF).joinpath(name).is_dir()


def options_with(entry: Entry) -> list[str]:
    """What to type so that a graph has this stage (`match=l2`): the options whose file names it."""
    if entry.origin != "built in":  # offered to Hydra under its own name
        role, _, name = entry.name.partition(".")
        return [f"{'' if is_group(role) else '+'}{role}={name}"]
    return _options().get(entry.target, [])


@functools.cache
def _options() -> dict[str, list[str]]:
    import yaml

    found: dict[str, list[str]] = {}
    for folder in sorted(files(CONF).iterdir(), key=lambda folder: folder.name):
        for file in group_files(folder.name) if folder.is_dir() else ():
            target = (yaml.safe_load(file.read_text()) or {}).get("_target_")
            if target:
                found.setdefault(target, []).append(f"{folder.name}={file.name.removesuffix('.yaml')}")
    return found

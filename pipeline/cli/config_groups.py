"""The groups of configuration that omninav brings: which option puts which stage into a graph.

A group's options are its files, those of `options.yaml`, and, where a role of stages has its name, every stage of that
role: `match=l2` takes `match.l2` with its defaults. A file is there for what is longer than a few lines.
"""

import functools
from collections.abc import Iterable, Mapping, Sequence
from importlib.resources import files
from importlib.resources.abc import Traversable
from typing import Any

import yaml

from omninav.pipeline.graph.problems import Problem, ProblemsFound, suggest
from omninav.pipeline.graph.registry import Entry, built_in_stage, is_role, of_role, plugins

from .tools import tools

CONF = "omninav.conf"
LEARN = "learn"
"""The group whose options are artifacts that can be made by themselves."""


def group_files(group: str) -> list[Traversable]:
    """The option files of a group, by name; none where there is no such group."""
    folder = files(CONF).joinpath(group)
    found = [file for file in folder.iterdir() if file.name.endswith(".yaml")] if folder.is_dir() else []
    return sorted(found, key=lambda file: file.name)


def option_content(group: str, option: str) -> dict[str, Any]:
    """The content of an option that has a file, or in `options.yaml` more than a node; {} of any other."""
    if group.isidentifier() and option.isidentifier() and files(CONF).joinpath(group, f"{option}.yaml").is_file():
        return _read(f"{group}/{option}.yaml")
    content = _listed().get(group, {}).get(option, {})
    return {} if _is_node(content) else content


def suggest_option(group: str, option: str, options: Iterable[str], kind: str, prefix: str = "") -> str:
    """A hint for an option that a group does not have: what took its place, or what is like it."""
    command = option.removesuffix("_live").replace("_", " ")
    if group == "variant" and command in tools():
        return f"it is a command; type omninav {command} …; `omninav {command} --help` shows what it takes"
    if group in config_file() and not is_group(group):
        return f"a folder {group} in the --config-dir makes a group of this setting; move or rename that folder"
    for entry in plugins():
        if entry.name == f"{group}.{option}":
            return entry.problem or f"`omninav stages {group}` says what is wrong with it"
        if entry.name.partition(".")[2] == option:
            return f"OMNINAV_STAGES or a package names it '{entry.name}'; here it must be '{group}.{option}'"
    return replaced().get(f"{group}={option}") or suggest(option, options, kind, prefix)


@functools.cache
def replaced() -> dict[str, str]:
    """Reads hints for options (`group=option`) and settings that are gone: name -> what to type."""
    return _read("replaced.yaml")


@functools.cache
def stand_ins() -> tuple[tuple[str, str, dict[str, Any]], ...]:
    """Reads which option of a group another replaces: group, option, and the rule (see `take_stand_ins`)."""
    listed = ((name.partition("="), rule) for name, rule in _read("stand_ins.yaml").items())
    return tuple((group, option, rule) for (group, _, option), rule in listed)


def learnable() -> list[str]:
    """The artifacts that can be made by themselves (`learn=NAME`, `omninav NAME`)."""
    return [*_listed()[LEARN]]


def is_group(name: str) -> bool:
    """Tells whether configuration has a group of that name."""
    return bool(name) and (name in listed_groups() or files(CONF).joinpath(name).is_dir())


@functools.cache
def listed_groups() -> tuple[str, ...]:
    """The groups that every configuration is composed of, in the order of `config.yaml`."""
    listed = (next(iter(item)) for item in config_file()["defaults"] if isinstance(item, dict))
    return tuple(name for name in listed if not name.startswith("override "))


def listed_option(group: str, name: str) -> dict[str, Any] | None:
    """An option without a file: of `options.yaml`, or the node of the built-in stage of its name; None: neither."""
    if group not in listed_groups():
        return None
    listed = _listed().get(group, {}).get(name)
    entry = built_in_stage(group, name) if listed is None else None
    return {"_target_": entry.target} if entry is not None else listed


def node_option(group: str, name: str) -> dict[str, Any] | None:
    """The node that an option is; None where it is none."""
    listed = listed_option(group, name)
    return listed if listed is not None and _is_node(listed) else None


def listed_options(group: str) -> list[str]:
    """The options of a group that have no file, by name. Imports the stages of its role."""
    offered = group in listed_groups() and is_role(group)
    stages = [entry.name.partition(".")[2] for entry in of_role(group)] if offered else []
    return [*_listed().get(group, ()), *stages]


@functools.cache
def _listed() -> dict[str, dict[str, dict[str, Any]]]:
    """The content of `options.yaml`: group -> option -> a node, or what else it changes in a configuration."""
    return _read("options.yaml")


def _is_node(content: Mapping[str, Any]) -> bool:
    return "_target_" in content


def group_options(group: str) -> list[str]:
    """All options of a group that omninav brings, by name. Imports its stages."""
    return sorted({file.name.removesuffix(".yaml") for file in group_files(group)} | {*listed_options(group)})


def refuse_null_groups(words: Sequence[str]) -> None:
    """Raise `ProblemsFound` at `match=null`, on which Hydra stumbles without a word about what to type."""
    for word in words:
        name, _, value = word.partition("=")
        if value == "null" and name.isidentifier() and is_group(name):
            one_node = is_role(name) or any(map(_is_node, _listed().get(name, {}).values()))
            what = f"'~nodes.{name}' '~wires.{name}'" if one_node else f"'~{name}'"
            raise ProblemsFound([Problem(name, "it cannot be swapped for nothing", f"to take it out, type {what}")])


def settings_left_open() -> list[str]:
    """The settings that are null until they are given: what a run may be of. A variant names those that it takes."""
    return [name for name, value in config_file().items() if value is None and name not in ("variant", "objective")]


@functools.cache
def config_file() -> dict[str, Any]:
    """Reads the top of every configuration, `config.yaml`."""
    return _read("config.yaml")


def _read(name: str) -> dict[str, Any]:
    return dict(yaml.load(files(CONF).joinpath(name).read_text(encoding="utf-8"), yaml.CSafeLoader) or {})


def options_with(entry: Entry) -> list[str]:
    """Lists the options that are this stage: `match=l2`, and those of `options.yaml` that name it.

    Not `ROLE=NAME` where configuration has the stage only in nodes of other names: its ports are not those of the role.
    """
    role, _, name = entry.name.partition(".")
    if entry.origin != "built in":  # offered to Hydra under its own name
        return [f"{'' if is_group(role) else '+'}{role}={name}"]
    nodes, chosen = _uses()
    fits = role in nodes.get(entry.target, {role}) or (role, name) in chosen
    own = [f"{role}={name}"] if fits and node_option(role, name) else []
    listed = ((group, name, node) for group, options in _listed().items() for name, node in options.items())
    named = (f"{group}={name}" for group, name, node in listed if node.get("_target_") == entry.target)
    return list(dict.fromkeys([*own, *named]))


@functools.cache
def _uses() -> tuple[dict[str, set[str]], set[tuple[str, str]]]:
    """The nodes and groups that hold each stage in configuration, and the options that files choose for groups."""
    nodes: dict[str, set[str]] = {}
    chosen: set[tuple[str, str]] = set()
    for group, options in _listed().items():
        for node in filter(_is_node, options.values()):
            nodes.setdefault(node["_target_"], set()).add(group)
    folders = (folder for folder in files(CONF).iterdir() if folder.is_dir() and folder.name != "experiment")
    contents = [_read(f"{folder.name}/{file.name}") for folder in folders for file in group_files(folder.name)]
    while contents:
        content = contents.pop()
        contents += [value for value in content.values() if isinstance(value, dict)]
        for name, node in (content.get("nodes") or {}).items():
            if node and "_target_" in node:
                nodes.setdefault(node["_target_"], set()).add(name)
        for item in content.get("defaults") or ():
            if isinstance(item, dict):
                chosen |= {(key.rpartition("/")[2], str(option)) for key, option in item.items()}
    return nodes, chosen

"""Configurations, composed by Hydra and completed: the graphs of artifacts too, everything resolved."""

import copy
import functools
import os
import re
import sys
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from hydra.core.config_store import ConfigStore
from omegaconf import DictConfig, OmegaConf
from omegaconf.errors import OmegaConfBaseException

from omninav.pipeline.graph.ports import convert_fields
from omninav.pipeline.graph.problems import Problem, ProblemsFound, suggest
from omninav.pipeline.graph.registry import plugins
from omninav.pipeline.graph.stage import Bounds
from omninav.pipeline.run.artifact_specification import ArtifactSpecification, read_specifications, without_absent
from omninav.pipeline.run.inputs import not_taken, read_inputs

from .arguments import read_flags
from .artifact_graph import MAKING, is_repeatable, unfit_changes, words_of_graph
from .composition_cache import TYPED
from .config_groups import config_file, listed_groups, replaced, settings_left_open, stand_ins
from .hydra_session import hydra_started, interrupts_kept
from .overrides import composed_of
from .stand_ins import contradictions, take_stand_ins

OF_THE_VARIANT = ("variant", "inputs", "nodes", "wires", "artifacts", "saves")
"""Keys that a variant's file sets; everything else in a configuration is a setting."""
OF_THE_RUN = ("seed", "runs", "cache", "checkpoint_s", "validate", "record", "objective", "plots")
"""Settings that every run reads, whatever its graph is."""
OF_OTHERS = ("experiment", "hydra", TYPED)
"""Blocks that are read before the graph is made."""
OF_COMMANDS = ("defaults", "profile", "transport")
"""Keys of config.yaml that Hydra or a command reads."""
UNSET = "(unset)"
INTERPOLATION = re.compile(r"\$\{(?:oc\.select:|unless:(\w+),)?\s*(\w+)")

LINK = re.compile(r"\$\{(\w+)\}")
"""A value that is another setting."""


def _unless(given: str, wanted: str, *, _root_: Any) -> Any:
    """`${unless:a,b}`: the setting `b`, or, where `a` is given, the default of its reader."""
    return UNSET if _root_[given] is not None else _root_[wanted]


OmegaConf.register_new_resolver("unless", _unless, replace=True)


def read_words(arguments: Sequence[str]) -> tuple[list[str], list[str]]:
    """The overrides among arguments that may hold Hydra's flags, and the folders of `--config-dir`."""
    read = read_flags(arguments)
    return read.overrides, [read.config_dir] if read.config_dir else []


@contextmanager
def composed(arguments: Sequence[str], offer: bool = True) -> Iterator[Any]:
    """The configuration that overrides (and --config-dir) describe, for commands that run nothing."""
    words, folders = read_words(arguments)
    if offer:
        offer_plugins()
    with hydra_started(folders):
        yield composed_of(words, folders)


def offer_plugins() -> None:
    """Let `match=gradient` find a third party's stage `match.gradient`, as those of omninav are found."""
    for entry in plugins():
        if entry.problem:
            print(f"plugin left out: {entry.problem}", file=sys.stderr)
            continue
        if entry.role in settings_left_open():  # a setting takes it by its own name
            continue
        name = entry.name.partition(".")[2]
        ConfigStore.instance().store(name, {"_target_": entry.target}, group=entry.role, package=f"nodes.{entry.role}")


@interrupts_kept()
def complete(config: Any) -> dict[str, Any]:
    """A composed configuration, resolved, with the graphs of its artifacts composed too: plain dicts, all written out.

    An artifact's graph is its variant's, under this run's settings but for those that the artifact sets, and with the
    nodes that it inherits. Settings that nothing reads are left out.
    """
    _refuse_no_mappings(config)
    try:
        _name_past_links(config)
        take_stand_ins(config)
        plain: dict[str, Any] = _without_taken_out(OmegaConf.to_container(config, resolve=True))  # type: ignore[arg-type]
        specs = read_specifications(plain)
        read = {*OF_THE_VARIANT, *OF_THE_RUN, *read_inputs(plain), *settings_read(config)}
        of_run = {name: plain[name] for name in RunSettings.__dataclass_fields__ if name in plain}
        problems = [*not_taken(plain, settings_left_open()), *_nothing_named(plain)]
        problems += convert_fields(of_run, RunSettings, "")[1]
        problems += [*contradictions(config), *_unknown_settings(config, read), *_unread_settings(config, read)]
        for name, spec in specs.items():
            problems += [*_given_twice(config, name, spec), *_given_alone(name, spec, specs)]
            if spec.variant is not None:
                where = f"artifacts.{name}.variant"
                problems.append(Problem(where, "this setting is gone", replaced().get(where, "")))
        if problems:
            raise ProblemsFound(problems)
        graph_of = functools.cache(lambda maker: _graph_of(config, maker, specs))
        for name, spec in specs.items():
            own = plain["artifacts"][name]
            maker = spec.together_with or name
            making = specs[maker]
            choices = making.choices if making.required else None
            if choices is not None:
                own["variant"] = f"{choices.get('variant', config.variant)}_{maker}"
                own["made_from"] = sorted(set(_linked(config, maker).values()))
            elif making is spec:  # how it would be made is nothing that this run does
                plain["artifacts"][name] = own = {key: own[key] for key in own if key not in MAKING}
            if spec.file is not None:
                own["file"] = _past_links(spec.file)
            elif choices is not None and making.file is None and not _lacks(config, maker):
                graph, its_settings = graph_of(maker)
                own["graph"] = copy.deepcopy(graph)
                if "set" in own:
                    own["set"] = {key: value for key, value in own["set"].items() if key in its_settings}
    except OmegaConfBaseException as error:
        where = getattr(error, "full_key", None) or "config"
        raise ProblemsFound([Problem(str(where), str(error).split("\n")[0])]) from None
    return _without_unset({name: value for name, value in plain.items() if name in read})


def _refuse_no_mappings(config: Any) -> None:
    """Raise `ProblemsFound` where a part of the graph is no mapping of names, or a variant has none of them."""
    if isinstance(config.get("variant"), DictConfig):
        hint = "begin the variant's file with the line `# @package _global_`"
        raise ProblemsFound([Problem("variant", "its file's content is below `variant`", hint)])
    parts = {part: config.get(part) for part in ("nodes", "wires", "artifacts")}
    wrong = [part for part, given in parts.items() if not isinstance(given, DictConfig | None)]
    if wrong:
        hint = "write names and what each is below it"
        raise ProblemsFound([Problem(part, f"expected a mapping, found {parts[part]!r:.60}", hint) for part in wrong])


def _unknown_settings(config: Any, read: Collection[str]) -> Iterator[Problem]:
    """A problem for each setting that config.yaml does not have and the graph does not read.

    `read`: the settings that the graph and the run read.
    """
    known = {*config_file(), *_groups(), *OF_OTHERS, *read}
    for name in config:
        if name not in known:
            yield Problem(str(name), "there is no such setting", suggest(str(name), known, "settings"))


def _groups() -> set[str]:
    """The groups of options that every configuration chooses from."""
    return {item for entry in config_file()["defaults"] if isinstance(entry, Mapping) for item in entry}


def _unread_settings(config: Any, read: Collection[str]) -> Iterator[Problem]:
    """A problem for each setting that was typed and that nothing of the run reads."""
    hints = {name: hint for _, _, rule in stand_ins() for name, hint in rule["unread"].items()}
    elsewhere = {*OF_THE_VARIANT, *OF_THE_RUN, *OF_OTHERS, *OF_COMMANDS, *settings_left_open(), *_taken_over(config)}
    typed = {str(name).partition(".")[0] for name in config.get(TYPED) or ()}
    emptied = {name for name in typed & _groups() if name in config and config[name] is None}  # by another option
    for name in sorted((({*hints, *config_file()} & typed - {*read}) | emptied) - elsewhere):
        leave = f"leave {name}=… out"
        yield Problem(name, "nothing in this run reads it", leave if name in emptied else hints.get(name, leave))


def _nothing_named(plain: Mapping[str, Any]) -> Iterator[Problem]:
    for name in settings_left_open():
        if isinstance(plain.get(name), str) and not plain[name].strip():
            yield Problem(name, "nothing follows the =", f"name it, as {name}=FILE, or leave {name}= out")


@dataclass(frozen=True)
class RunSettings:
    """Values that every run reads beside its seed."""

    runs: str
    cache: str | None
    checkpoint_s: Annotated[float, Bounds(ge=0, le=1e6)]
    validate: bool


def _graph_of(config: Any, name: str, specs: Mapping[str, ArtifactSpecification]) -> tuple[dict[str, Any], set[str]]:
    """The graph that makes an artifact, and the settings that it reads."""
    spec = specs[name]
    try:
        other = composed_of(words_of_graph(str(config.variant), spec.choices or {}))
    except ProblemsFound as found:
        where = f"artifacts.{name}.choices"
        raise ProblemsFound(Problem(where, problem.what, problem.hint) for problem in found.problems) from None
    OmegaConf.set_struct(other, False)
    given: Any = OmegaConf.to_container(config, resolve=False)
    own: Any = OmegaConf.to_container(other, resolve=False)
    for key in (key for key in given if key not in OF_THE_VARIANT):
        if key not in own or given[key] != own[key]:  # to set a large block takes long, and it is the same
            other[key] = given[key]
    for key, value in spec.set.items():
        if key not in other or key in OF_THE_VARIANT:
            settings = [str(setting) for setting in other if setting not in OF_THE_VARIANT]
            hint = suggest(key, settings, "settings")
            raise ProblemsFound([Problem(f"artifacts.{name}.set.{key}", "there is no such setting", hint)])
        other[key] = value
    take_stand_ins(other)
    absent = {*spec.inherit} - {*other.nodes}
    for each in (spec, *(other for other in specs.values() if other.together_with == name)):
        for node in filter(lambda node: is_repeatable(config.nodes[node]), each.inherit):
            other.nodes[node] = OmegaConf.to_container(config.nodes[node], resolve=False)
        problems = unfit_changes(name, each.nodes, other.nodes)
        if problems:
            raise ProblemsFound(problems)
        for block, changes in ((other.nodes, each.nodes), (other.wires, each.wires)):
            for node, change in changes.items():
                block[node] = OmegaConf.merge(block.get(node) or {}, change)
    graph = {key: OmegaConf.to_container(other[key], resolve=True) for key in ("nodes", "wires", "artifacts", "saves")}
    # What makes an artifact begins without those it can do without.
    made = dict(without_absent(_without_unset(_without_taken_out(graph))))
    if absent:
        made["nodes"] = dict(sorted(made["nodes"].items(), key=lambda item: _place_in_groups(item[0])))
    return {key: made.get(key) for key in ("nodes", "wires", "saves")}, settings_read(other)


def _place_in_groups(node: str) -> int:
    """Place of a node that an option gives: in the order of the groups, before the nodes of none."""
    groups = listed_groups()
    return groups.index(node) if node in groups else len(groups)


# inputs of artifacts


def _linked(config: Any, name: str) -> dict[str, str]:
    """Settings of an artifact's graph that are other settings of this run (`set: {a: ${b}}`): name -> that one."""
    changed = config.artifacts[name].get("set")
    raw: Any = OmegaConf.to_container(changed, resolve=False) if changed is not None else {}
    links = {key: LINK.fullmatch(value) for key, value in raw.items() if isinstance(value, str)}
    return {key: link[1] for key, link in links.items() if link}


def _given_twice(config: Any, name: str, spec: ArtifactSpecification) -> Iterator[Problem]:
    for key, setting in _linked(config, name).items():
        if config.get(setting) is not None and spec.file is not None:
            hint = f"leave one of them out: {name}=FILE uses a saved one, {setting}=… makes one"
            yield Problem(name, f"both a file and {setting}=… to make it from are given", hint)
        elif config.get(setting) is not None and config.get(key) is None and key in config.inputs:
            yield Problem(key, f"{setting} is given, but no {key}", f"type {key}=…")


def _given_alone(
    name: str, spec: ArtifactSpecification, specs: Mapping[str, ArtifactSpecification]
) -> Iterator[Problem]:
    if spec.file is not None and spec.together_with is not None and specs[spec.together_with].file is None:
        other = spec.together_with
        hint = f"type {other}=FILE.omap too, with which it was saved; or leave {name}=FILE out, and both are made"
        yield Problem(name, f"it is given as a file, and the {other} that it belongs to is not", hint)


def _lacks(config: Any, name: str) -> bool:
    """Tells whether this run is of something that was given, and what its artifact is made from was not."""
    return any(config.get(key) is not None and config.get(s) is None for key, s in _linked(config, name).items())


def _name_past_links(config: Any) -> None:
    """Names paths among the runs past their link, which will soon point elsewhere."""
    runs = os.path.realpath(str(config.get("runs", "runs")))
    for key in settings_left_open():
        file = OmegaConf.select(config, key)  # whose errors name the key
        if isinstance(file, str) and Path(file).is_file() and Path(file).resolve().is_relative_to(runs):
            config[key] = _past_links(file)


def _past_links(file: str) -> str:
    """A file's own path where it is named by way of a link."""
    own = os.path.realpath(file)  # Path.resolve raises RuntimeError on a link to itself, until Python 3.13
    return file if own == os.path.abspath(file) else own


# settings that are read


def settings_read(config: Any) -> set[str]:
    """The settings that the graph and its artifacts read, directly or by way of other settings.

    A block that an artifact's `set` takes over whole is written there, and is none of them.
    """
    read: set[str] = set()
    waiting = list(OF_THE_VARIANT)
    raw: Any = OmegaConf.to_container(config, resolve=False)
    while waiting:
        text = str(raw[waiting.pop()])
        for unless, name in INTERPOLATION.findall(text):
            names = [unless] if unless and config.get(unless) is not None else [unless, name] if unless else [name]
            for each in names:
                if each in config and each not in read:
                    read.add(each)
                    waiting.append(each)
    return read - {*OF_THE_VARIANT, *_taken_over(config)}


def _taken_over(config: Any) -> set[str]:
    """The blocks of settings that an artifact's `set` is."""
    specs: Any = OmegaConf.to_container(config.artifacts, resolve=False) if config.artifacts else {}
    given = (str((spec or {}).get("set")) for spec in specs.values())
    return {link[1] for link in map(LINK.fullmatch, given) if link}


def _without_taken_out(config: dict[str, Any]) -> dict[str, Any]:
    """A configuration without the artifacts and what is saved that a variant upon another sets to null.

    Inputs that are null `read_inputs` leaves out.
    """
    blocks = {
        block: {name: value for name, value in config[block].items() if value is not None}
        for block in ("artifacts", "saves")
        if isinstance(config.get(block), Mapping)
    }
    return {**config, **blocks}


def _without_unset(config: dict[str, Any]) -> dict[str, Any]:
    """Nodes without the parameters that are unset: their classes' defaults hold."""
    nodes = {
        name: {key: value for key, value in spec.items() if value != UNSET} if isinstance(spec, Mapping) else spec
        for name, spec in (config.get("nodes") or {}).items()
    }
    return {**config, "nodes": nodes}

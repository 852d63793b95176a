"""What every configuration file promises: it opens with what it is and a command that composes."""

import functools
import itertools
import re
import shlex
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml
from offenders import assert_each
from omegaconf import OmegaConf

from omninav.pipeline.cli.commands.simulate import LIVE
from omninav.pipeline.cli.composition import complete, settings_read
from omninav.pipeline.cli.composition_cache import compose
from omninav.pipeline.cli.config_groups import config_file, option_content, settings_left_open
from omninav.pipeline.cli.hydra_session import hydra_started
from omninav.pipeline.cli.overrides import with_unlisted_parameters
from omninav.pipeline.cli.variant_inputs import inputs_of
from omninav.pipeline.graph.ports import convert
from omninav.pipeline.graph.registry import resolve
from omninav.pipeline.graph.signature import signature
from omninav.pipeline.run.inputs import read_inputs
from omninav.pipeline.run.prepared_run import PreparedRun, prepare_run

CONF = Path(__file__).resolve().parents[2] / "conf"
OPTIONS = CONF / "options.yaml"
FILES = [
    path
    for path in sorted(CONF.rglob("*.yaml"))
    if path.parent != CONF and path.name != "test_worlds.yaml" and path.parent.name != "recording"
]


def group(path: Path) -> str:
    return path.relative_to(CONF).parts[0]


FOLDERS = {name: [*files] for name, files in itertools.groupby(FILES, group)}
each_folder = pytest.mark.parametrize("files", FOLDERS.values(), ids=FOLDERS)
VARIANTS = [path.stem for path in FOLDERS["variant"]]


@pytest.fixture(autouse=True, scope="module")
def hydra():
    with hydra_started():
        yield


def head(path: Path) -> list[str]:
    return path.read_text().split("\n")[:2]


@each_folder
def test_a_files_first_line_is_its_package_and_its_second_says_what_it_is(files: list[Path]):
    assert_each(files, opens_as_it_should)


def opens_as_it_should(path: Path) -> None:
    package, said = head(path)
    role = group(path)
    content = yaml.safe_load(path.read_text()) or {}
    graph = any(key in content for key in ("nodes", "wires", "inputs"))
    packages = ["_global_"] if role == "variant" or graph else [role, f"world.{role.removeprefix('world_')}"]
    assert package in [f"# @package {name}" for name in packages]
    assert re.match(r"# .{10,}\.  omninav \S", said), said


def stages_in(path: Path) -> Iterator[tuple[str, dict[str, Any]]]:
    """The nodes of a file that name their stage, each with its place in the file."""
    content = yaml.safe_load(path.read_text()) or {}
    content = content if path == OPTIONS else {group(path): {path.stem: content}}
    whole = {f"{role}.{name} ": each for role, options in content.items() for name, each in options.items()}
    for where, each in whole.items():
        for name, node in {"": each, **(each.get("nodes") or {})}.items():
            if isinstance(node, dict) and "_target_" in node:
                yield f"{where}{name}", dict(node)


@each_folder
def test_the_command_in_a_files_head_composes(files: list[Path]):
    assert_each(files, command_composes)


def command_composes(path: Path) -> None:
    command = shlex.split(head(path)[1].partition("  omninav ")[2])
    option = path.relative_to(CONF / group(path)).with_suffix("")
    if group(path) != "graph":  # its files are included by variants
        assert f"{'+' if group(path) == 'experiment' else ''}{group(path)}={option}" in command, command
    words = [word for word in command if not word.startswith("-")]
    words = [*LIVE, *words[1:]] if words[:1] == ["simulate"] else words
    if group(path) != "experiment":  # these are composed, with their conditions, in test_every_experiment.py
        compose(with_unlisted_parameters(words, []))


def graphs_of(path: Path) -> set[str]:
    """The shared graphs that a file includes or makes its map with, and those that these include."""
    content = yaml.safe_load(path.read_text()) or {}
    named = {entry.removeprefix("/graph/") for entry in content.get("defaults", []) if isinstance(entry, str)}
    map = (content.get("artifacts") or {}).get("map") or {}
    named.add((map.get("choices") or {}).get("graph", ""))
    graphs = [CONF / "graph" / f"{name}.yaml" for name in named]
    others = [CONF / "variant" / f"{name}.yaml" for name in named]
    files = [file for file in (*graphs, *others) if file.exists()]
    return {file.stem for file in files if file in graphs}.union(*(graphs_of(file) for file in files))


def test_a_shared_graph_is_included_by_the_variant_in_its_head():
    assert_each(FOLDERS["graph"], graph_is_included)


def graph_is_included(path: Path) -> None:
    words = shlex.split(head(path)[1].partition("  omninav ")[2])
    if words[0] == "simulate":
        assert LIVE[1] == f"+graph={path.stem}"
        return
    variant = next(word.removeprefix("variant=") for word in words if word.startswith("variant="))
    assert path.stem in graphs_of(CONF / "variant" / f"{variant}.yaml")


@each_folder
def test_a_file_states_only_what_differs_from_its_stages_defaults(files: list[Path]):
    assert_each(files, no_default_is_repeated)


def no_default_is_repeated(path: Path) -> None:
    for where, stage in stages_in(path):
        parameters = signature(resolve(stage.pop("_target_"))).parameters
        assert set(stage) <= set(parameters), where
        for name, value in stage.items():
            converted, problems = convert(value, parameters[name].type, f"{where}.{name}")
            interpolated = isinstance(value, str) and "${" in value
            assert interpolated or problems or converted != parameters[name].default, (
                f"{where}.{name} repeats the default"
            )


def test_an_option_without_a_file_says_what_it_is_and_states_what_differs():
    no_default_is_repeated(OPTIONS)
    found = re.findall(r"^  # (.{10,}\.)  omninav (.*)\n  (\w+):", OPTIONS.read_text(), re.MULTILINE)
    options = [(role, name) for role, listed in yaml.safe_load(OPTIONS.read_text()).items() for name in listed]
    together: dict[tuple[str, ...], dict[str, list[str]]] = {}
    for (role, name), (_, typed, described) in zip(options, found, strict=True):
        words, own = shlex.split(typed), f"{role}={name}"
        assert described == name
        assert own in words
        rest = tuple(word for word in words if word != own)
        together.setdefault(rest, {}).setdefault(role, []).append(own)
    for rest, of_role in together.items():  # a composition takes an option of each role
        for chosen in itertools.zip_longest(*of_role.values()):
            compose(with_unlisted_parameters([*filter(None, chosen), *rest], []))


def test_every_variant_builds():
    assert_each(VARIANTS, builds)


def builds(variant: str) -> None:
    found = prepared(variant)
    assert found.variant == variant
    assert found.graph.nodes
    if compose([f"variant={variant}"]).artifacts.get("map"):
        learned = prepared(variant, "learn=map")
        assert learned.variant == f"{variant}_map"
        assert "map" in learned.saves


def test_no_belief_is_lost_over_a_tick_without_an_image():
    wires = {variant: [w for w in prepared(variant).graph.wires if w.delay] for variant in VARIANTS}
    delayed = {name: [w.hold for w in each if w.origin == "fusion.belief"] for name, each in wires.items()}
    assert sum(len(each) for each in delayed.values()) > 10
    assert {name for name, each in delayed.items() if not all(each)} == set()


def test_every_variant_builds_without_what_it_is_measured_by():
    measured = [variant for variant in VARIANTS if "drive" in nodes_of(variant)]
    assert len(measured) > 15
    for variant in measured:
        left = nodes_of(variant, "~evaluation")
        assert left < nodes_of(variant), variant
        assert "drive" not in left, variant
        assert ("estimate" in left) == ("fusion" in left), variant


@functools.cache
def prepared(variant: str, *words: str) -> PreparedRun:
    return prepare_run(complete(compose([f"variant={variant}", *words])))


def nodes_of(variant: str, *words: str) -> set[str]:
    return set(prepared(variant, *words).graph.nodes)


def test_a_variant_declares_the_inputs_that_its_graph_reads():
    assert_each(VARIANTS, declares_its_inputs)


def declares_its_inputs(variant: str) -> None:
    config = compose([f"variant={variant}"])
    listed = inputs_of(variant, config_file()["defaults"], option_content)  # as `omninav variants` reads them
    assert listed == read_inputs({"inputs": OmegaConf.to_container(config.inputs)})
    declared = {name for name, meaning in config.inputs.items() if meaning is not None}
    read = settings_read(config) & {*settings_left_open(), *declared}
    assert read <= declared
    if read != declared:  # what else it declares, it reads on a robot
        live = compose([f"variant={variant}", "source=live"])
        assert declared <= read | settings_read(live)


def test_every_group_is_listed_before_the_variant():
    defaults = yaml.safe_load((CONF / "config.yaml").read_text())["defaults"]
    groups = [next(iter(item)) for item in defaults if isinstance(item, dict)]
    folders = {path.name for path in CONF.iterdir() if path.is_dir() and any(path.glob("*.yaml"))}
    assert folders - {"recording", "graph", "experiment"} <= set(groups)
    assert OmegaConf.load(CONF / "config.yaml").nodes == {}


def test_no_group_hides_a_setting() -> None:
    settings = set(yaml.safe_load((CONF / "config.yaml").read_text()))
    groups = {path.name for path in CONF.iterdir() if path.is_dir()}
    assert settings & groups == {"variant"}  # which the variant's own file sets

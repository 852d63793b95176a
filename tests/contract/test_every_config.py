"""What every configuration file promises: it opens with what it is and a command that composes."""

import re
import shlex
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml
from omegaconf import OmegaConf

from omninav.pipeline.cli.composition import complete, settings_read
from omninav.pipeline.cli.composition_cache import compose
from omninav.pipeline.cli.config_groups import settings_left_open
from omninav.pipeline.cli.experiments import resolved_but_for_the_experiment
from omninav.pipeline.cli.hydra_session import hydra_started
from omninav.pipeline.cli.overrides import with_unlisted_parameters
from omninav.pipeline.experiment.specification import read_experiment
from omninav.pipeline.graph.ports import convert
from omninav.pipeline.graph.registry import resolve
from omninav.pipeline.graph.signature import signature
from omninav.pipeline.run.plan import plan

CONF = Path(__file__).resolve().parents[2] / "conf"
FILES = [
    path
    for path in sorted(CONF.rglob("*.yaml"))
    if path.name not in ("config.yaml", "test_worlds.yaml") and path.parent.name != "recording"
]
each = pytest.mark.parametrize("path", FILES, ids=lambda path: f"{path.parent.name}/{path.stem}")


@pytest.fixture(autouse=True, scope="module")
def hydra():
    with hydra_started():
        yield


def group(path: Path) -> str:
    return path.relative_to(CONF).parts[0]


def head(path: Path) -> list[str]:
    return path.read_text().split("\n")[:2]


@each
def test_its_first_line_is_its_package_and_its_second_says_what_it_is(path: Path):
    package, said = head(path)
    role = group(path)
    content = yaml.safe_load(path.read_text()) or {}
    graph = any(key in content for key in ("nodes", "wires", "inputs"))
    wanted = "_global_" if role in ("variant", "results", "ablation") or graph else None
    of_a_stage = "_target_" in content
    of_the_world = f"world.{role.removeprefix('world_')}"
    packages = [wanted] if wanted else [f"nodes.{role}"] if of_a_stage else [role, of_the_world]
    assert package in [f"# @package {name}" for name in packages]
    assert re.match(r"# .{10,}\.  omninav \S", said), said


def stages_in(path: Path) -> Iterator[tuple[str, dict[str, Any]]]:
    """The nodes of a file that name their stage, each with its place in the file."""
    content = yaml.safe_load(path.read_text()) or {}
    nodes = content.get("nodes") or {}
    for where, node in [("", content), *((f"nodes.{name}", node) for name, node in nodes.items())]:
        if isinstance(node, dict) and "_target_" in node:
            yield where, dict(node)


@each
def test_the_command_in_its_head_composes(path: Path):
    command = shlex.split(head(path)[1].partition("  omninav ")[2])
    option = path.relative_to(CONF / group(path)).with_suffix("")
    if group(path) != "graph":  # its files are included by variants
        assert f"{'+' if group(path) == 'experiment' else ''}{group(path)}={option}" in command, command
    words = [word for word in command if not word.startswith("-")]
    compose(with_unlisted_parameters(words, []))


def graphs_of(path: Path) -> set[str]:
    """The shared graphs that a file includes, and those that these include."""
    content = yaml.safe_load(path.read_text()) or {}
    named = {entry.removeprefix("/graph/") for entry in content.get("defaults", []) if isinstance(entry, str)}
    named = {name for name in named if (CONF / "graph" / f"{name}.yaml").exists()}
    return named.union(*(graphs_of(CONF / "graph" / f"{name}.yaml") for name in named))


@pytest.mark.parametrize("path", sorted((CONF / "graph").glob("*.yaml")), ids=lambda path: path.stem)
def test_a_shared_graph_is_included_by_the_variant_in_its_head(path: Path):
    variant = shlex.split(head(path)[1].partition("  omninav ")[2])[0].removeprefix("variant=")
    assert path.stem in graphs_of(CONF / "variant" / f"{variant}.yaml")


@each
def test_it_states_only_what_differs_from_its_stages_defaults(path: Path):
    for where, stage in stages_in(path):
        parameters = signature(resolve(stage.pop("_target_"))).parameters
        assert set(stage) <= set(parameters), where
        for name, value in stage.items():
            converted, problems = convert(value, parameters[name].type, f"{where}.{name}")
            interpolated = isinstance(value, str) and "${" in value
            assert interpolated or problems or converted != parameters[name].default, (
                f"{where}.{name} repeats the default"
            )


@pytest.mark.parametrize("path", sorted((CONF / "variant").glob("*.yaml")), ids=lambda path: path.stem)
def test_every_variant_builds(path: Path):
    planned = plan(complete(compose([f"variant={path.stem}"])))
    assert planned.variant == path.stem
    assert planned.graph.nodes


def test_every_variant_builds_without_what_it_is_measured_by():
    measured = [path.stem for path in sorted((CONF / "variant").glob("*.yaml")) if "drive" in nodes_of(path.stem)]
    assert len(measured) > 20
    for variant in measured:
        left = nodes_of(variant, "~evaluation")
        assert left < nodes_of(variant), variant
        assert "drive" not in left, variant
        assert ("estimate" in left) == ("fusion" in left), variant


def nodes_of(variant: str, *words: str) -> set[str]:
    return set(plan(complete(compose([f"variant={variant}", *words]))).graph.nodes)


@pytest.mark.parametrize("path", sorted((CONF / "variant").glob("*.yaml")), ids=lambda path: path.stem)
def test_a_variant_declares_the_inputs_that_its_graph_reads(path: Path):
    config = compose([f"variant={path.stem}"])
    declared = {name for name, meaning in config.inputs.items() if meaning is not None}
    read = settings_read(config) & {*settings_left_open(), *declared}
    assert read <= declared
    if read != declared:  # what else it declares, it reads on a robot
        live = compose([f"variant={path.stem}", "source=live"])
        assert declared <= read | settings_read(live)


@pytest.mark.parametrize("path", sorted((CONF / "experiment").glob("*/*.yaml")), ids=lambda path: path.stem)
@pytest.mark.parametrize("profile", ["full", "quick"])
def test_every_experiment_can_be_read(path: Path, profile: str):
    option = path.relative_to(CONF / "experiment").with_suffix("")
    config = resolved_but_for_the_experiment(compose([f"+experiment={option}"]))
    experiment = read_experiment(config["experiment"], profile)
    assert experiment.claims or path.stem in ("home_store", "office")  # to start from
    assert experiment.conditions()


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

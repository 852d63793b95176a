"""The parts of Hydra and OmegaConf that they do not promise to keep are used where it is said why, and nowhere else."""

import ast
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PRIVATE = {
    "pipeline/cli/config_sources.py: omegaconf._utils.get_yaml_loader"  # which texts are numbers, for a faster reader
}
METHODS = ("_get_node", "_set_value", "_apply_overrides_to_config", "_instantiate")


def _private(tree: ast.Module) -> Iterator[str]:
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and (node.module or "").partition(".")[0] in ("hydra", "omegaconf"):
            yield from (f"{node.module}.{each.name}" for each in node.names if "._" in f"{node.module}.{each.name}")
        elif isinstance(node, ast.Attribute) and node.attr in METHODS:
            yield node.attr


def test_private_parts_of_hydra_are_those_that_are_listed():
    files = [
        file
        for folder in ("pipeline", "stages", "omninav", "hydra_plugins")
        for file in sorted((ROOT / folder).glob("**/*.py"))
    ]
    found = {
        f"{file.relative_to(ROOT)}: {name}"
        for file in files
        if not file.is_relative_to(ROOT / "omninav") or file.parent == ROOT / "omninav"
        for name in _private(ast.parse(file.read_text(encoding="utf-8")))
    }
    assert found == PRIVATE


def test_a_private_part_is_noticed():
    text = "from hydra._internal import core_plugins\nfrom hydra.core import utils\nnode = config._get_node(key)\n"
    assert [*_private(ast.parse(text))] == ["hydra._internal.core_plugins", "_get_node"]


def test_omegaconf_still_has_its_rules_for_numbers():
    from omegaconf._utils import get_yaml_loader

    assert {*"0123456789-+."} <= {*get_yaml_loader().yaml_implicit_resolvers}

"""The layers that pyproject.toml states hold the whole tree, and nothing can be added beside them."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
LINTER = Path(sys.executable).parent / "lint-imports"
pytestmark = pytest.mark.skipif(not LINTER.exists(), reason="import-linter is not installed: pip install -e '.[dev]'")


@pytest.fixture
def tree(tmp_path: Path) -> Path:
    """The checkout without what no contract speaks of."""
    shutil.copy(ROOT / "pyproject.toml", tmp_path)
    for name in ("omninav", "pipeline", "stages"):
        shutil.copytree(ROOT / name, tmp_path / name, symlinks=True, ignore=shutil.ignore_patterns("__pycache__"))
    (tmp_path / "conf").mkdir()
    return tmp_path


def lint(tree: Path) -> subprocess.CompletedProcess[str]:
    environment = {**os.environ, "PYTHONPATH": str(tree), "COLUMNS": "200"}
    return subprocess.run(
        [LINTER, "--no-cache"], cwd=tree, capture_output=True, text=True, env=environment, timeout=120
    )


def test_the_layers_hold(tree: Path):
    ended = lint(tree)
    assert ended.returncode == 0, ended.stdout + ended.stderr
    assert "0 broken" in ended.stdout


STRAYS = {
    "pipeline.graph.stray": "omninav.stages.values.pose",
    "stages.match.stray": "omninav.stages.features",
    "stages.geometry.stray": "omninav.stages.values.pose",
}
"""Modules that import against the arrows: the framework from a stage, a role from another, geometry from values."""


def test_imports_against_the_arrows_are_refused(tree: Path):
    for module, imported in STRAYS.items():
        (tree / f"{module.replace('.', '/')}.py").write_text(f"import {imported}\n")
    ended = lint(tree)
    assert ended.returncode != 0
    assert [module for module in STRAYS if f"omninav.{module} -> " not in ended.stdout] == [], ended.stdout


@pytest.mark.parametrize("folder", ["stages/newrole", "pipeline/newroom"])
def test_a_folder_that_no_contract_knows_is_refused(tree: Path, folder: str):
    (tree / folder).mkdir()
    (tree / folder / "__init__.py").write_text('"""A new place."""\n')
    ended = lint(tree)
    assert ended.returncode != 0
    assert folder.rpartition("/")[2] in ended.stdout

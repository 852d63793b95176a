"""The layers that pyproject.toml states hold the whole tree, and nothing can be added beside them."""

import os
import re
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


@pytest.mark.parametrize(
    ("file", "text"),
    [
        ("stages/newrole/__init__.py", '"""A new place."""'),
        ("pipeline/newroom/__init__.py", '"""A new place."""'),
        ("pipeline/graph/stray.py", "import omninav.stages.values.pose"),
        ("stages/match/stray.py", "import omninav.stages.features"),
        ("stages/geometry/stray.py", "import omninav.stages.values.pose"),
    ],
    ids=["a new role", "a new room", "the framework from a stage", "a role from another", "geometry from values"],
)
def test_a_folder_that_no_contract_knows_and_an_import_against_the_arrows_are_refused(tree: Path, file: str, text: str):
    (tree / file).parent.mkdir(exist_ok=True)
    (tree / file).write_text(f"{text}\n")
    ended = lint(tree)
    assert ended.returncode != 0
    assert re.search("stray|newrole|newroom", ended.stdout)

"""The additions that CONTRIBUTING.md shows work in a copy of the source tree."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "CONTRIBUTING.md").read_text()
FILES = dict(re.findall(r"\*\*([\w/.]+)\*\* \(new file\):\n\n```\w+\n(.*?)```\n", PAGE, re.DOTALL))


@pytest.fixture(scope="module")
def tree(tmp_path_factory: pytest.TempPathFactory) -> Path:
    copy = tmp_path_factory.mktemp("tree")
    for folder in ("pipeline", "stages", "conf", "omninav"):  # with what was compiled of it
        shutil.copytree(ROOT / folder, copy / folder, symlinks=True)
    shutil.copytree(ROOT / "tests", copy / "tests", ignore=shutil.ignore_patterns("__pycache__", "data", "test_*.py"))
    shutil.copy(ROOT / "pyproject.toml", copy)
    for name, content in FILES.items():
        assert not (copy / name).exists()
        (copy / name).write_text(content)
    return copy


def run(tree: Path, *words: str) -> None:
    done = subprocess.run(
        [sys.executable, *words],
        cwd=tree,
        env={**os.environ, "PYTHONPATH": str(tree)},
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert done.returncode == 0, done.stdout + done.stderr


def test_each_addition_touches_as_many_files_as_it_says() -> None:
    sections = dict(re.findall(r"^## (Add [\w ]+)\n(.*?)(?=^## |\Z)", PAGE, re.DOTALL | re.MULTILINE))
    counts = {title: len(re.findall(r"\(new file\)", text)) for title, text in sections.items()}
    assert counts == {"Add a stage": 2, "Add a variant": 1, "Add a metric": 2, "Add a camera": 2, "Add a log format": 2}
    assert not any(name.startswith("pipeline/") for name in FILES)


def test_the_tests_on_the_page_pass(tree: Path) -> None:
    run(tree, "-m", "pytest", "-q", *(name for name in FILES if name.startswith("tests/")))


def test_the_commands_on_the_page_compose(tree: Path) -> None:
    typed = r"^omninav (variant=omniview_mcl match=\w+|variant=bhattacharyya_mcl|\+nodes.*)$"
    checks = [["check", *command.split()] for command in re.findall(typed, PAGE, re.MULTILINE)]
    assert len(checks) == 3
    run(tree, "-c", f"from omninav.pipeline.cli.main import main; assert not any([main(words) for words in {checks}])")

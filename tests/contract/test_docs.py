"""The documentation names files, classes and functions that exist."""

import ast
import re
import textwrap
from pathlib import Path

import yaml
from offenders import assert_each

ROOT = Path(__file__).parents[2]
PAGES = sorted([*ROOT.glob("*.md"), *ROOT.glob("docs/**/*.md"), ROOT / "runs/README.md", ROOT / "examples/README.md"])
PAPERS = ROOT / "docs/papers.md"


def names_in(file: Path) -> set[str]:
    nodes = ast.walk(ast.parse(file.read_text()))
    return {node.name for node in nodes if isinstance(node, ast.ClassDef | ast.FunctionDef)}


def test_links_and_paths_of_every_page_exist() -> None:
    assert_each(PAGES, links_and_paths_exist)


def links_and_paths_exist(page: Path) -> None:
    text = page.read_text()
    links = [link for link in re.findall(r"\]\(([^)#\s]+)[^)]*\)", text) if "://" not in link]
    paths = re.findall(r"`((?:stages|pipeline|conf|docs|tests|examples|benchmarks)/[\w./]+)`", text)
    missing = [link for link in links if not (page.parent / link).exists()]
    missing += [path for path in paths if not (ROOT / path).exists()]
    assert not missing


def test_code_on_every_page_can_be_read() -> None:
    assert_each(PAGES, code_can_be_read)


def code_can_be_read(page: Path) -> None:
    blocks = re.findall(r"^```(python|yaml)\n(.*?)^```", page.read_text(), re.MULTILINE | re.DOTALL)
    for language, code in blocks:
        ast.parse(textwrap.dedent(code)) if language == "python" else list(yaml.safe_load_all(code))


def test_a_page_names_every_folder() -> None:
    tree = (ROOT / "docs/extending.md").read_text().partition("## Where things are")[2]
    folders = [each for each in ROOT.glob("*/*/") if each.parent.name in ("pipeline", "stages")]
    named = [each.name for each in folders if not each.name.startswith("_")]
    assert len(named) > 15
    assert not [name for name in named if f"{name}/" not in tree]


def test_every_class_and_function_beside_a_file_is_defined_in_it() -> None:
    rows = re.findall(r"`((?:stages|pipeline)/[\w/]+\.py)`((?:,? `\w+`)+)", PAPERS.read_text())
    assert len(rows) > 40
    missing = [
        (file, name)
        for file, names in rows
        for name in re.findall(r"`(\w+)`", names)
        if (ROOT / file).exists() and name not in names_in(ROOT / file)
    ]
    assert not missing


def test_every_erratum_that_the_code_names_is_listed() -> None:
    listed = set(re.findall(r"^\* \*\*(\d+a?)\.\*\*", PAPERS.read_text(), re.MULTILINE))
    code = "\n".join(file.read_text() for file in ROOT.glob("stages/**/*.py"))
    named = {
        number
        for group in re.findall(r"(?i)\berrat(?:um|a) ([\da, and]+)", code)
        for number in re.findall(r"\d+a?", group)
    }
    assert len(named) > 30
    assert named <= listed

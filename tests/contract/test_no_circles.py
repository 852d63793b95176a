"""No file imports itself by way of others, also where an import is made only for types, or inside a function."""

import ast
from collections.abc import Iterator
from pathlib import Path

import networkx as nx
import pytest

ROOT = Path(__file__).resolve().parents[2] / "omninav"


def modules() -> dict[str, Path]:
    """Every module of the package by its full name."""
    found = {}
    for part in ("pipeline", "stages"):
        for path in sorted((ROOT / part).resolve().rglob("*.py")):
            inside = path.relative_to((ROOT / part).resolve()).with_suffix("").parts
            names = inside[:-1] if inside[-1] == "__init__" else inside
            found[".".join(("omninav", part, *names))] = path
    return found


def imported(name: str, path: Path) -> Iterator[str]:
    """The names that a module imports anywhere."""
    package = name if path.name == "__init__.py" else name.rpartition(".")[0]
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            above = package.split(".")[: len(package.split(".")) - node.level + 1] if node.level else []
            origin = ".".join([*above, *([node.module] if node.module else [])])
            yield origin
            yield from (f"{origin}.{alias.name}" for alias in node.names)


def circles(files: dict[str, Path]) -> list[list[str]]:
    graph = nx.DiGraph()
    graph.add_edges_from(
        (name, other) for name, path in files.items() for other in imported(name, path) if other in files
    )
    return [sorted(circle) for circle in nx.strongly_connected_components(graph) if len(circle) > 1]


def test_no_file_imports_itself_by_way_of_others():
    files = {name: path for name, path in modules().items() if path.name != "__init__.py"}
    assert len(files) > 200
    assert circles(files) == []


@pytest.mark.parametrize(
    "second",
    [
        "from .first import x",
        "import omninav.first",
        "if True:\n    from .first import x",
        "def at_need():\n    from .first import x",
    ],
)
def test_a_circle_is_found(tmp_path: Path, second: str):
    (tmp_path / "first.py").write_text("from .second import y")
    (tmp_path / "second.py").write_text(second)
    files = {f"omninav.{name}": tmp_path / f"{name}.py" for name in ("first", "second")}
    assert circles(files) == [["omninav.first", "omninav.second"]]

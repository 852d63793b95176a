"""Cached results are stale when code they follow from has changed, and only then."""

import ast
import importlib
import itertools
import shutil
import subprocess
import sys
from pathlib import Path
from unittest.mock import patch

import pytest

from omninav.pipeline.engine import code_version
from omninav.pipeline.graph import registry

ROOT = Path(__file__).resolve().parents[3]

STAGE = """
from omninav.pipeline import Context, Outputs, Stage
import toys
from . import near
from pack.deep.far import FAR
import pack.whole
import beside
import numpy

class Twice(Stage):
    class Out(Outputs):
        number: toys.Number
    def step(self, ctx: Context, number: toys.Number) -> Out:
        from .at_need import NEED
        return self.Out(number=number)
"""
FILES = {
    "pack/__init__.py": "",
    "pack/stage.py": STAGE,
    "pack/near.py": "x = 1",
    "pack/deep/__init__.py": "",
    "pack/deep/far.py": "from ..beyond import y\nFAR = 1",
    "pack/beyond.py": "y = 1",
    "pack/whole/__init__.py": "from .part import z",
    "pack/whole/part.py": "z = 1",
    "pack/at_need.py": "NEED = 1",
    "pack/other.py": "w = 1",
    "beside.py": "from beside_that import b",
    "beside_that.py": "b = 1",
}


def written(place: Path) -> Path:
    for name, text in FILES.items():
        (place / name).parent.mkdir(parents=True, exist_ok=True)
        (place / name).write_text(text + "\n")
    return place


def version(place: Path) -> str:
    """The version of the stage in a folder, read anew."""
    code_version._read.cache_clear()
    code_version._module_version.cache_clear()
    code_version._not_installed.cache_clear()
    with patch.dict(sys.modules), patch.object(sys, "path", [str(place), *sys.path]):
        module = importlib.import_module("pack.stage")
        assert Path(str(module.__file__)).is_relative_to(place)
        return code_version.module_version(module.__name__)


@pytest.mark.parametrize("name", FILES)
def test_a_change_in_what_a_stage_imports_is_another_version_and_one_elsewhere_is_not(
    tmp_path: Path, name: str
) -> None:
    before = version(written(tmp_path / "before"))
    changed = written(tmp_path / "changed")
    (changed / name).write_text(FILES[name] + "\nchanged = True\n")
    assert (version(changed) == before) is (name == "pack/other.py")


def test_a_stage_in_a_file_follows_what_lies_beside_it_and_nothing_that_is_installed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "mine.py").write_text("import beside\nimport numpy\nimport json\nimport omninav\n")
    (tmp_path / "beside.py").write_text("b = 1\n")
    monkeypatch.syspath_prepend(str(tmp_path))
    module = registry._load(str(tmp_path / "mine.py"))
    found = []
    for text in ("b = 1\n", "b = 2\n"):
        (tmp_path / "beside.py").write_text(text)
        code_version._read.cache_clear()
        code_version._module_version.cache_clear()
        code_version._not_installed.cache_clear()
        found.append(code_version.module_version(module.__name__))
    assert found[0] != found[1]
    assert code_version._not_installed("beside") == tmp_path / "beside.py"
    assert not any(map(code_version._not_installed, ("numpy", "json", "omninav", "omninav.stages", "nowhere_at_all")))


@pytest.mark.parametrize(
    "text",
    [
        "if a: import b\ntry: from .c import d; import e.f as g\nfinally: pass",
        "from . import (h,  # (one of two)\n    i)",
        "from .import j\nfrom .. k import l",
        "from m import n, \\\n    o",
        '"""Poses come\nfrom p import q without a word.\n"""\nimport r',
    ],
)
def test_imports_are_found_however_they_are_written(text: str) -> None:
    found = set(code_version._imported(text, "pack.deep"))
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Import):
            assert {alias.name for alias in node.names} <= found
        elif isinstance(node, ast.ImportFrom):
            inside = ["", "pack.deep.", "pack."][node.level] + (node.module or "")
            assert {f"{inside.rstrip('.')}.{alias.name}" for alias in node.names} <= found


DIGEST = """
from omninav.pipeline.engine.code_version import graph_digest
from omninav.pipeline.graph.builder import build
print(graph_digest(build({"nodes": {"source": {"_target_": "toys.Count"}}, "wires": {}}, {})))
"""


def of_graph(place: Path) -> str:
    """The digest of a graph that is run by the framework in a folder."""
    tests = str(Path(__file__).parents[2])
    environment = {"PYTHONPATH": f"{place}:{tests}", "PATH": "/usr/bin:/bin", "PYTHONDONTWRITEBYTECODE": "1"}
    command = [sys.executable, "-c", DIGEST]
    return subprocess.run(command, env=environment, capture_output=True, text=True, check=True, cwd=place).stdout


def test_a_change_of_the_engine_is_another_digest_and_one_of_a_command_is_not(tmp_path: Path) -> None:
    for name in ("pipeline", "__init__.py", "working_directory.py"):
        origin = ROOT / "omninav" / name
        (shutil.copytree if origin.is_dir() else shutil.copyfile)(origin, tmp_path / "omninav" / name)
    found = [of_graph(tmp_path)]
    for changed in ("engine/engine.py", "graph/builder.py", "cli/terminal.py"):
        with (tmp_path / "omninav" / "pipeline" / changed).open("a") as file:
            file.write("changed = True\n")
        found.append(of_graph(tmp_path))
    faked = tmp_path / "numpy-99.0.dist-info" / "METADATA"
    faked.parent.mkdir()
    faked.write_text("Metadata-Version: 2.1\nName: numpy\nVersion: 99.0\n")
    found.append(of_graph(tmp_path))
    assert [first == second for first, second in itertools.pairwise(found)] == [False, False, True, False]


@pytest.mark.parametrize("library", code_version.LIBRARIES)
def test_another_version_of_any_library_is_another_digest(library: str, monkeypatch: pytest.MonkeyPatch) -> None:
    before, version = code_version.surroundings(), code_version.version
    monkeypatch.setattr(code_version, "version", lambda name: "99.0" if name == library else version(name))
    code_version.surroundings.cache_clear()
    changed = code_version.surroundings()
    monkeypatch.undo()
    code_version.surroundings.cache_clear()
    assert changed != before == code_version.surroundings()


@pytest.mark.parametrize("folder", ["site-packages", "dist-packages"])
def test_what_another_python_has_installed_is_not_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, folder: str
) -> None:
    """A system's packages beside an environment's, as with ROS: the source of numpy takes 15 s at each start."""
    (tmp_path / folder).mkdir()
    (tmp_path / folder / "of_another_python.py").touch()
    monkeypatch.syspath_prepend(str(tmp_path / folder))
    code_version._not_installed.cache_clear()
    assert code_version._not_installed("of_another_python") is None

"""Which code, libraries, parameters and wires a graph's results follow from, and the commit of omninav itself."""

import ast
import dataclasses
import functools
import importlib.metadata
import importlib.util
import inspect
import json
import platform
import re
import subprocess
import sys
from collections.abc import Iterable, Iterator
from pathlib import Path

from omninav.pipeline.files import digest_text
from omninav.pipeline.graph.graph import Graph
from omninav.pipeline.graph.registry import SOURCE

LIBRARIES = (
    "numpy",
    "scipy",
    "opencv-python-headless",
    "numba",
    "llvmlite",
    "poselib",
    "faiss-cpu",
    "networkx",
    "hydra-core",
    "mcap",
    "rosbags",
)
"""Distributions whose versions a run states, and on which its results depend."""
DECIDING = ("files.py", "graph", "engine", "run", "mcap")
"""The framework's code that results follow from; commands, experiments and reports only show them."""
FRAMEWORK = Path(__file__).resolve().parents[1]


@functools.cache
def version(distribution: str) -> str:
    """The installed version of a distribution, or that there is none."""
    try:
        return importlib.metadata.version(distribution)
    except importlib.metadata.PackageNotFoundError:
        return "not installed"


def git_commit() -> str | None:
    """The commit of omninav's own checkout, with a mark where files differ from it; None where there is none."""
    here = Path(__file__).resolve().parents[2]
    own = ["--git-dir", str(here / ".git"), "--work-tree", str(here)]  # no other's, whose settings name programs
    command = ["git", *own, "describe", "--always", "--dirty", "--abbrev=40"]
    try:
        ended = subprocess.run(command, cwd=here, capture_output=True, encoding="utf-8", errors="replace", timeout=5)
    except (OSError, subprocess.TimeoutExpired):
        return None
    return ended.stdout.strip() or None if ended.returncode == 0 else None


@functools.cache
def surroundings() -> str:
    """A hash over what every graph runs in: the framework's code, and the versions of Python and the libraries."""
    files = [file for part in DECIDING for file in sorted([FRAMEWORK / part, *(FRAMEWORK / part).rglob("*.py")])]
    code = [
        text
        for file in files
        if file.is_file()
        for text in (str(file.relative_to(FRAMEWORK)), file.read_text(encoding="utf-8"))
    ]
    versions = [f"{name} {version(name)}" for name in LIBRARIES]
    return digest_text(platform.python_version(), platform.machine(), *versions, *code)


def graph_digest(graph: Graph, only: Iterable[str] | None = None) -> str:
    """A hash over stages' code, parameters and wires, of the whole graph, or of some nodes and what enters them; and
    over the `surroundings` in which they run."""
    names = sorted(graph.nodes if only is None else only)
    parts = [surroundings()]
    for name in names:
        node = graph.nodes[name]
        parameters = json.dumps(node.parameters, sort_keys=True, default=str)
        parts += [name, node.target, module_version(type(node.stage).__module__), parameters]
    parts += sorted(str(dataclasses.astuple(wire)) for wire in graph.wires if wire.to_node in set(names))
    return digest_text(*parts)


def module_version(module: str, without: str = "") -> str:
    """A hash over the source of a loaded module and of all that it imports of its own package, directly or not.

    A change there makes a stage's cached results stale, one elsewhere in the package does not. Imports are read off the
    source, so that those count as well which run at need only. A user's stage may also import modules that are not
    installed, as from files beside its own: they count too. What other packages hold counts by its version, where it is
    one of `LIBRARIES`. Modules of the package `without` are left out.
    """
    return _module_version(module, without, vars(sys.modules[module]).get(SOURCE))


@functools.cache
def _module_version(module: str, without: str, loaded: str | None) -> str:
    file = Path(inspect.getfile(sys.modules[module])).resolve()
    root = file.parent
    while (root / "__init__.py").exists():
        root = root.parent
    inside = file.relative_to(root).with_suffix("").parts
    names = module.split(".")
    outer = ".".join([*names[: -len(inside)], inside[0]])  # the package's full name; or the module's, without one
    found: dict[str, str] = {}
    to_read = [module]
    if ".".join(names[-len(inside) :]) != ".".join(inside):  # a file that was given by its path: it has no package
        text = file.read_text(encoding="utf-8") if loaded is None else loaded
        found[inside[-1]], to_read = digest_text(text), [*_imported(text, "")]
    while to_read:
        name = to_read.pop()
        if name in found or (without and f"{name}.".startswith(f"{without}.")):
            continue
        own = f"{name}.".startswith(f"{outer}.")
        place = _file_of(root / inside[0], name[len(outer) + 1 :]) if own else _not_installed(name)
        if place is not None:
            found[name], imported = _read(place, name)
            to_read += [name.rpartition(".")[0], *imported]  # a package's own file runs before its modules
    return digest_text(*(text for name in sorted(found) for text in (name.removeprefix(outer), found[name])))


INSTALLED = {"site-packages", "dist-packages"}
"""Folders of installed packages, of whichever Python: those of a system, a user or another environment count too."""


@functools.cache
def _not_installed(name: str) -> Path | None:
    """The file of a module that is neither installed nor of Python or omninav, and so has no version."""
    top, _, rest = name.partition(".")
    try:
        spec = None if top in ("omninav", *sys.stdlib_module_names) else importlib.util.find_spec(top)
    except (ImportError, ValueError):
        spec = None
    file = Path(spec.origin if spec is not None and spec.origin else "").resolve()
    if file.suffix != ".py" or INSTALLED & {*file.parts}:
        return None
    return _file_of(file.parent if file.name == "__init__.py" else file.with_suffix(""), rest)


@functools.cache
def _file_of(package: Path, name: str) -> Path | None:
    path = package.joinpath(*name.split(".")) if name else package
    files = (path / "__init__.py", path.with_name(f"{path.name}.py"))
    return next((file for file in files if file.is_file()), None)


@functools.cache
def _read(file: Path, name: str) -> tuple[str, tuple[str, ...]]:
    """Hash of a module's source, and the names that it imports."""
    text = file.read_text(encoding="utf-8")
    return digest_text(text), tuple(_imported(text, name if file.name == "__init__.py" else name.rpartition(".")[0]))


IMPORT = re.compile(
    r"(?:^|[;:])[ \t]*(import[ \t][^\n]+|from[ \t.][ \t.\w]*?\bimport\b[ \t]*(?:\([^)]*\)|[^\n]+))", re.MULTILINE
)
"""A statement that imports, wherever a line or a block may begin with it, and prose that looks like one."""


def _imported(text: str, package: str) -> Iterator[str]:
    try:
        tree = ast.parse("\n".join(IMPORT.findall(text)))  # a tenth of the time
    except SyntaxError:  # prose, or brackets within brackets
        tree = ast.parse(text)
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            above = package.split(".")[: len(package.split(".")) - node.level + 1] if node.level else []
            origin = ".".join([*above, *([node.module] if node.module else [])])
            yield origin
            yield from (f"{origin}.{alias.name}" for alias in node.names)  # each may be a module itself

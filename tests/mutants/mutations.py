"""The mutants of a file: where they are, what they make of it, and which are not counted."""

from dataclasses import dataclass
from itertools import zip_longest
from pathlib import Path

import parso
from cosmic_ray.ast import ast_nodes
from cosmic_ray.operators.operator import Operator
from parso.tree import BaseNode, NodeOrLeaf
from slips import OPERATORS

UNCOUNTED = {"raise_stmt", "assert_stmt", "decorator", "import_from", "fstring"}
"""Error messages, what only type checkers read, and text."""
TITLES = "Quantity"
"""A call that says how pages name a figure."""
CHECKS = "strict"
"""An argument that checks what is so already: `zip(…, strict=True)`."""
SHARED_CODE = {"property", "cached_property", "staticmethod", "classmethod", "override"}
"""Decorators that leave the function as it is."""


@dataclass(frozen=True)
class Function:
    """A function of a module or class that can be changed in place."""

    name: str
    """Qualified: `Class.method`."""
    line: int
    """Its first, decorators included."""


@dataclass(frozen=True)
class Mutant:
    """One change in one file."""

    file: str
    """Relative to the repository."""
    line: int
    """Where the change is."""
    start: int
    end: int
    text: str
    """What stands in place of the file's characters from `start` to `end`."""
    before: str
    """The first line that differs, without its indentation."""
    after: str
    function: Function | None
    """Whose body holds it; None: what runs when the module is imported, and what is compiled."""

    def source(self, original: str) -> str:
        """The file with the change."""
        return original[: self.start] + self.text + original[self.end :]

    def __str__(self) -> str:
        return f"{self.file}:{self.line}\n  - {self.before}\n  + {self.after}"


def mutants(root: Path, file: str) -> list[Mutant]:
    """All mutants of a file that are counted and compile."""
    original = (root / file).read_text()
    tree = parso.parse(original)
    nodes = [node for node in ast_nodes(tree) if _counted(node)]
    found = []
    for operator in OPERATORS:
        for node in nodes:
            for index, (at, _) in enumerate(list(operator.mutation_positions(node))):
                changed = _changed(tree, operator, node, index)
                if _compiles(changed, file):
                    found.append(_mutant(file, original, changed, at[0], _function(node)))
    return found


def _changed(tree: NodeOrLeaf, operator: Operator, node: NodeOrLeaf, index: int) -> str:
    """The source with a change, which is then taken back."""
    parts = [part for part in ast_nodes(node)]
    kept = [(part, list(part.children) if isinstance(part, BaseNode) else part.value) for part in parts]
    above = node.parent.children
    place = next(k for k, child in enumerate(above) if child is node)
    above[place] = operator.mutate(node, index)
    changed = str(tree.get_code())
    above[place] = node
    for part, was in kept:
        if isinstance(part, BaseNode):
            part.children = was
        else:
            part.value = was
    return changed


def _mutant(file: str, original: str, changed: str, line: int, function: Function | None) -> Mutant:
    start = next(k for k, (a, b) in enumerate(zip_longest(original, changed)) if a != b)
    rest = zip_longest(reversed(original[start:]), reversed(changed[start:]))
    tail = next(k for k, (a, b) in enumerate(rest) if a != b)
    pairs = zip(original.splitlines(), changed.splitlines(), strict=False)
    before, after = next((a.strip(), b.strip()) for a, b in pairs if a != b)
    end = len(original) - tail
    return Mutant(file, line, start, end, changed[start : len(changed) - tail], before, after, function)


def _compiles(source: str, file: str) -> bool:
    try:
        compile(source, file, "exec")
    except SyntaxError:
        return False
    return True


def _counted(node: NodeOrLeaf) -> bool:
    while (above := node.parent) is not None:
        kind = above.type
        if kind in UNCOUNTED or (kind == "annassign" and node is above.children[1]) or (kind == "tfpdef"):
            return False
        if kind == "funcdef" and above.annotation is node:
            return False
        if kind == "argument" and above.children[0].get_code().strip() == CHECKS:
            return False
        if kind in ("atom_expr", "power") and above.children[0].get_code().strip() == TITLES:
            return False
        node = above
    return True


def _function(node: NodeOrLeaf) -> Function | None:
    """The outermost function, where the node lies in its body and its decorators leave it as it is."""
    names: list[str] = []
    found: Function | None = None
    while (above := node.parent) is not None:
        if above.type == "funcdef":
            outer = above.parent
            decorated = outer.type == "decorated"
            decorators = outer.children[0].get_code() if decorated else ""
            plain = {word.strip().lstrip("@") for word in decorators.splitlines() if word.strip()} <= SHARED_CODE
            body = node is above.children[-1]
            found = Function(above.name.value, (outer if decorated else above).start_pos[0]) if body and plain else None
            names = []
        elif above.type == "classdef":
            names.append(above.name.value)
        node = above
    return Function(".".join([*reversed(names), found.name]), found.line) if found else None

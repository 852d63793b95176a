"""How a mutant is put in the place of the code that a process has imported, and taken back."""

import gc
import os
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from types import CodeType, FunctionType, ModuleType
from typing import Any

from mutations import Function, Mutant

Change = Callable[[], Callable[[], None]]
"""Makes the change; what it gives takes it back."""
COMPILED = ("@compiled", "njit")
"""Marks of files whose functions are kept compiled on disk, by what the file on disk says."""


class Imported:
    """What a process has imported of the repository."""

    def __init__(self, root: Path) -> None:
        self.root = root
        self.modules = {self._file(each.__file__): each for each in list(sys.modules.values()) if _has_file(each)}
        self.functions: dict[tuple[str, Function], list[FunctionType]] = {}
        names: dict[str, str] = {}
        for each in gc.get_objects():
            if isinstance(each, FunctionType):
                code = each.__code__
                if code.co_filename not in names:
                    names[code.co_filename] = self._file(code.co_filename)
                key = names[code.co_filename], Function(code.co_qualname, code.co_firstlineno)
                self.functions.setdefault(key, []).append(each)

    def _file(self, path: str) -> str:
        return os.path.relpath(os.path.realpath(path), self.root)

    def change(self, mutant: Mutant) -> Change | None:
        """How to make a change, for whoever has imported what changes; None where only a new import does."""
        original = (self.root / mutant.file).read_text()
        whole = compile(mutant.source(original), str(self.root / "omninav" / mutant.file), "exec")
        if mutant.function is None:
            return self.executed(mutant.file, whole)
        targets = self.functions.get((mutant.file, mutant.function), [])
        code = next((each for each in _codes(whole) if _place(each) == mutant.function), None)
        if code is None or not targets or any(each.__code__.co_freevars != code.co_freevars for each in targets):
            return None
        return lambda: _swapped(targets, code)

    def unchanged(self, file: str) -> Change | None:
        """A module executed anew as it is: whether tests bear that."""
        original = (self.root / file).read_text()
        return self.executed(file, compile(original, str(self.root / "omninav" / file), "exec"))

    def executed(self, file: str, whole: CodeType) -> Change | None:
        """A module executed anew, its functions and classes put in the place of the former ones everywhere."""
        module = self.modules.get(file)
        if module is None or any(mark in (self.root / file).read_text() for mark in COMPILED):
            return None
        return lambda: _executed(module, whole)


def _swapped(targets: list[FunctionType], code: CodeType) -> Callable[[], None]:
    originals = [function.__code__ for function in targets]
    for function in targets:
        function.__code__ = code

    def back() -> None:
        for function, original in zip(targets, originals, strict=True):
            function.__code__ = original

    return back


def _executed(module: ModuleType, whole: CodeType) -> Callable[[], None]:
    names = vars(module)
    former = dict(names)
    exec(whole, names)
    own = {name: each for name, each in former.items() if getattr(each, "__module__", None) == module.__name__}
    instead = {id(each): names[name] for name, each in own.items() if name in names}
    changed: list[tuple[dict[str, Any], str, Any]] = []
    for other in list(sys.modules.values()):
        if isinstance(other, ModuleType) and other is not module:
            for name, value in list(vars(other).items()):
                if id(value) in instead:
                    changed.append((vars(other), name, value))
                    vars(other)[name] = instead[id(value)]

    def back() -> None:
        names.clear()
        names.update(former)
        for place, name, value in changed:
            place[name] = value

    return back


def _has_file(module: object) -> bool:
    return isinstance(module, ModuleType) and isinstance(getattr(module, "__file__", None), str)


def _place(code: CodeType) -> Function:
    return Function(code.co_qualname, code.co_firstlineno)


def _codes(code: CodeType) -> Iterator[CodeType]:
    yield code
    for each in code.co_consts:
        if isinstance(each, CodeType):
            yield from _codes(each)

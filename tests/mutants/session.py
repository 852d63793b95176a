"""One session of pytest in which every mutant of a folder runs, each in a process of its own.

Tests are collected once. They run once under coverage, so that of each line it is known which tests reach it and how
long they work. Then each mutant gets a fork of this process, in which the changed function's code is put in the place
of the original's, for whoever imported it; the tests that reach its line run, quick ones first, until one fails.
"""

import gc
import os
import pickle
import resource
import signal
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from types import CodeType, FunctionType

import coverage
import pytest
from _pytest.runner import runtestprotocol
from mutations import Function, Mutant

QUICK_S = 3.0
"""A test that works longer is asked only where no quicker one reaches the line."""
SETUP = "set-up of "

Reached = dict[str, dict[int, set[int]]]


class MutantSession:
    """Plugin of pytest: in place of the tests it runs the mutants, and keeps what became of each."""

    def __init__(
        self, root: Path, mutants: list[Mutant], jobs: int, survived: Callable[[Mutant, list[str]], object]
    ) -> None:
        self.root, self.mutants, self.jobs, self.survived = root, mutants, jobs, survived
        self.coverage: coverage.Coverage | None = None
        self.ends: dict[Mutant, str] = {}
        self.asked: dict[Mutant, list[str]] = {}
        self.items: list[pytest.Item] = []

    @pytest.hookimpl(tryfirst=True)
    def pytest_runtestloop(self, session: pytest.Session) -> bool:
        """In place of the tests."""
        if session.testsfailed:
            raise session.Failed("tests cannot be collected")
        self.items = session.items
        reached, seconds = self._observed()
        functions = _functions(self.root)
        running: dict[int, Mutant] = {}
        gc.freeze()  # a fork that collects garbage would copy all of the memory
        for mutant in self.mutants:
            chosen = self._chosen(mutant, reached, seconds)
            self.asked[mutant] = [self.items[k].nodeid for k in chosen]
            code = self._changed(mutant)
            targets = functions.get((mutant.file, mutant.function), []) if mutant.function else []
            if not chosen:
                self.ends[mutant] = "no test"
                self.survived(mutant, [])
                continue
            if code is None or not targets or any(each.__code__.co_freevars != code.co_freevars for each in targets):
                self.ends[mutant] = "import"
                continue
            allowed = 10.0 + 5.0 * sum(seconds[k] for k in chosen)
            running[self._forked(targets, code, chosen, allowed)] = mutant
            while len(running) >= self.jobs:
                self._ended(running)
        while running:
            self._ended(running)
        return True

    @pytest.hookimpl(wrapper=True, tryfirst=True)
    def pytest_runtest_setup(self, item: pytest.Item) -> Iterator[None]:
        """What runs here may have been for other tests of the file too."""
        if self.coverage:
            self.coverage.switch_context(SETUP + str(item.path))
        return (yield)

    @pytest.hookimpl(wrapper=True, tryfirst=True)
    def pytest_runtest_call(self, item: pytest.Item) -> Iterator[None]:
        """What runs here is of this test."""
        if self.coverage:
            self.coverage.switch_context(item.nodeid)
        return (yield)

    def _observed(self) -> tuple[Reached, list[float]]:
        """Which tests reach which lines, and the seconds that each works; in another process, which then ends."""
        kept = Path(tempfile.mkstemp(dir=self.root)[1])
        child = os.fork()
        if child == 0:
            with kept.open("wb") as file:
                pickle.dump(self._observe(), file)
            os._exit(0)
        os.waitpid(child, 0)
        reached, seconds, failed = pickle.loads(kept.read_bytes())
        if failed:
            pytest.exit("these fail: " + ", ".join(failed), returncode=1)
        return reached, seconds

    def _observe(self) -> tuple[Reached, list[float], list[str]]:
        files = sorted({each.file for each in self.mutants})
        measured = coverage.Coverage(data_file=None, include=[str(self.root / file) for file in files])
        self.coverage = measured
        measured.start()
        seconds, failed = [], []
        for item, after in zip(self.items, [*self.items[1:], None], strict=True):
            began = time.process_time()
            if any(report.failed for report in runtestprotocol(item, nextitem=after, log=False)):
                failed.append(item.nodeid)
            seconds.append(time.process_time() - began)
        measured.stop()
        of_context: dict[str, set[int]] = {}
        for k, item in enumerate(self.items):
            for context in (item.nodeid, SETUP + str(item.path)):
                of_context.setdefault(context, set()).add(k)
        reached: Reached = {}
        for file in files:
            lines = measured.get_data().contexts_by_lineno(str(self.root / file))
            reached[file] = {
                line: set().union(*(of_context.get(context, set()) for context in contexts))
                for line, contexts in lines.items()
            }
        return reached, seconds, failed

    def _chosen(self, mutant: Mutant, reached: Reached, seconds: list[float]) -> list[int]:
        """The tests that reach a mutant's line, those of its file's own test first, then quick ones.

        Whatever is compiled or runs at import is reached by all tests of the file; a line that no test reaches by none.
        """
        lines = reached[mutant.file]
        everywhere = set().union(*lines.values()) or set(range(len(self.items)))
        chosen = lines.get(mutant.line, set()) if mutant.function else everywhere
        quick = {k for k in chosen if seconds[k] <= QUICK_S}
        own = f"test_{Path(mutant.file).name}"
        return sorted(quick or chosen, key=lambda k: (self.items[k].path.name != own, seconds[k], k))

    def _changed(self, mutant: Mutant) -> CodeType | None:
        """The code of the changed function."""
        if mutant.function is None:
            return None
        changed = mutant.source((self.root / mutant.file).read_text())
        for code in _codes(compile(changed, str(self.root / "omninav" / mutant.file), "exec")):
            if Function(code.co_qualname, code.co_firstlineno) == mutant.function:
                return code
        return None

    def _forked(self, targets: list[FunctionType], code: CodeType, chosen: list[int], allowed: float) -> int:
        child = os.fork()
        if child:
            return child
        printed_to(Path(os.devnull))
        ends_after(int(allowed))
        for function in targets:
            function.__code__ = code
        failed = False
        for k, after in zip(chosen, [*chosen[1:], None], strict=True):
            following = None if after is None else self.items[after]
            if any(report.failed for report in runtestprotocol(self.items[k], nextitem=following, log=False)):
                failed = True
                break
        os._exit(int(failed))

    def _ended(self, running: dict[int, Mutant]) -> None:
        child, status = os.wait()
        if child in running:
            mutant = running.pop(child)
            self.ends[mutant] = "survived" if status == 0 else "killed"
            if status == 0:
                self.survived(mutant, self.asked[mutant])


def ends_after(seconds: int) -> None:
    """This process is killed after so many seconds of work, and after ten times as many that it may wait."""
    resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds))
    signal.alarm(10 * seconds)


def printed_to(file: Path) -> None:
    """Whatever this process prints goes to a file."""
    sys.stdout = sys.stderr = file.open("w", buffering=1)
    for stream in (1, 2):
        os.dup2(sys.stdout.fileno(), stream)


def _codes(code: CodeType) -> Iterator[CodeType]:
    yield code
    for each in code.co_consts:
        if isinstance(each, CodeType):
            yield from _codes(each)


def _functions(root: Path) -> dict[tuple[str, Function], list[FunctionType]]:
    """All functions of the repository that exist by now, however they were decorated."""
    found: dict[tuple[str, Function], list[FunctionType]] = {}
    names: dict[str, str] = {}
    for each in gc.get_objects():
        if isinstance(each, FunctionType):
            code = each.__code__
            file = code.co_filename
            if file not in names:
                names[file] = os.path.relpath(os.path.realpath(file), root)
            found.setdefault((names[file], Function(code.co_qualname, code.co_firstlineno)), []).append(each)
    return found

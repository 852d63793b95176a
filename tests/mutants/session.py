"""One session of pytest in which every mutant of a folder is tried.

Tests are collected once. They run once under coverage, so that of each line it is known which tests reach it and how
long they work. Then forks of this process try some mutants each: the change is put in the place of the original, for
whoever imported it; the tests that reach its line run, quick ones first, until one fails.
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
from typing import NamedTuple

import coverage
import pytest
from _pytest.runner import runtestprotocol
from changes import Change, Imported
from mutations import Mutant

QUICK_S = 3.0
"""A test that works longer is asked only where no quicker one reaches the line."""
SETUP = "set-up of "
BATCH = 20
"""Mutants that are tried in one process, one after the other: a process costs more than most trials."""
SURVIVES, KILLED, NOTICED = b"0", b"1", b"2"
UNCHANGED_S = 120
"""How long tests may work without a change."""

Reached = dict[str, dict[int, set[int]]]


class Trial(NamedTuple):
    """A mutant, how to make its change, and the tests to ask."""

    mutant: Mutant
    change: Change
    chosen: list[int]


class Batch(NamedTuple):
    """Mutants for one process; before the first it tries `unchanged`, which no test may notice."""

    trials: list[Trial]
    unchanged: Change | None = None


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
        self.seconds: list[float] = []

    @pytest.hookimpl(tryfirst=True)
    def pytest_runtestloop(self, session: pytest.Session) -> bool:
        """In place of the tests."""
        if session.testsfailed:
            raise session.Failed("tests cannot be collected")
        self.items = session.items
        reached, self.seconds = self._observed()
        batches = self._batches(Imported(self.root), reached)
        gc.freeze()  # a fork that collects garbage would copy all of the memory
        running: dict[int, tuple[Batch, int]] = {}
        while batches or running:
            while batches and len(running) < self.jobs:
                batch = batches.pop(0)
                child, told = self._forked(batch)
                running[child] = batch, told
            child, _ = os.wait()
            if child in running:
                batches[:0] = self._ended(*running.pop(child))
        return True

    def _batches(self, imported: Imported, reached: Reached) -> list[Batch]:
        """Mutants of functions together, and those of what runs at import file by file."""
        within: list[Trial] = []
        at_import: dict[str, list[Trial]] = {}
        for mutant in self.mutants:
            chosen = self._chosen(mutant, reached)
            self.asked[mutant] = [self.items[k].nodeid for k in chosen]
            change = imported.change(mutant)
            if not chosen:
                self._ends(mutant, "no test")
            elif change is None:
                self.ends[mutant] = "import"
            elif mutant.function is None:
                at_import.setdefault(mutant.file, []).append(Trial(mutant, change, chosen))
            else:
                within.append(Trial(mutant, change, chosen))
        files = [Batch(trials, imported.unchanged(file)) for file, trials in at_import.items()]
        return [*(Batch(within[k : k + BATCH]) for k in range(0, len(within), BATCH)), *files]

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

    def _chosen(self, mutant: Mutant, reached: Reached) -> list[int]:
        """The tests that reach a mutant's line, those of its file's own test first, then quick ones.

        Whatever is compiled or runs at import is reached by all tests of the file; a line that no test reaches by none.
        """
        lines = reached[mutant.file]
        everywhere = set().union(*lines.values()) or set(range(len(self.items)))
        chosen = lines.get(mutant.line, set()) if mutant.function else everywhere
        quick = {k for k in chosen if self.seconds[k] <= QUICK_S}
        own = f"test_{Path(mutant.file).name}"
        return sorted(quick or chosen, key=lambda k: (self.items[k].path.name != own, self.seconds[k], k))

    def _forked(self, batch: Batch) -> tuple[int, int]:
        """A process that tries some mutants, and where it tells of each whether it was killed, a byte for each.

        A last byte tells whether the tests that failed pass without a change, so that no mutant has spoilt another's
        trial.
        """
        here, there = os.pipe()
        child = os.fork()
        if child:
            os.close(there)
            return child, here
        try:
            self._tried(batch, there)
        finally:
            os._exit(1)  # whatever a mutant raised, nothing of the session is done twice

    def _tried(self, batch: Batch, there: int) -> None:
        """Try mutants in this process, which then ends."""
        printed_to(Path(os.devnull))
        if batch.unchanged is not None:
            ends_after(UNCHANGED_S)
            back = batch.unchanged()
            noticed = self._failing(sorted(set().union(*(trial.chosen for trial in batch.trials))))
            back()
            if noticed is not None:
                os.write(there, NOTICED)
                os._exit(0)
        failed = set()
        for trial in batch.trials:
            ends_after(10 + int(5.0 * sum(self.seconds[k] for k in trial.chosen)))
            try:
                back = trial.change()
            except Exception:  # it cannot be imported
                os._exit(1)
            by = self._failing(trial.chosen)
            back()
            failed |= {by} - {None}
            os.write(there, SURVIVES if by is None else KILLED)
        ends_after(UNCHANGED_S)
        os.write(there, SURVIVES if self._failing(sorted(failed)) is None else KILLED)
        os._exit(0)

    def _failing(self, chosen: list[int]) -> int | None:
        """The first of some tests that fails."""
        for k, after in zip(chosen, [*chosen[1:], None], strict=True):
            following = None if after is None else self.items[after]
            if any(report.failed for report in runtestprotocol(self.items[k], nextitem=following, log=False)):
                return k
        return None

    def _ended(self, batch: Batch, told: int) -> list[Batch]:
        """Keep what became of the mutants of a process that ended; those that it did not come to."""
        trials = batch.trials
        with os.fdopen(told, "rb") as pipe:
            ends = [bytes([each]) for each in pipe.read()]
        if NOTICED in ends or (batch.unchanged and not ends):
            self.ends |= {trial.mutant: "import" for trial in trials}
            return []
        if len(ends) > len(trials) and ends[-1] == KILLED and len(trials) > 1:
            return [Batch([trial], batch.unchanged) for trial in trials]
        for trial, end in zip(trials, ends, strict=False):
            self._ends(trial.mutant, "killed" if end == KILLED else "survived")
        if len(ends) >= len(trials):
            return []
        self._ends(trials[len(ends)].mutant, "killed")  # it did not end, or ended the process
        rest = trials[len(ends) + 1 :]
        return [Batch(rest, batch.unchanged)] if rest else []

    def _ends(self, mutant: Mutant, end: str) -> None:
        self.ends[mutant] = end
        if end != "killed":
            self.survived(mutant, self.asked[mutant])


def ends_after(seconds: int) -> None:
    """This process is killed after so many more seconds of work, and after ten times as many that it may wait."""
    _, most = resource.getrlimit(resource.RLIMIT_CPU)
    resource.setrlimit(resource.RLIMIT_CPU, (int(time.process_time()) + seconds, most))
    signal.alarm(10 * seconds)


def printed_to(file: Path) -> None:
    """Whatever this process prints goes to a file."""
    sys.stdout = sys.stderr = file.open("w", buffering=1)
    for stream in (1, 2):
        os.dup2(sys.stdout.fileno(), stream)

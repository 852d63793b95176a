"""One hostile input at a time: made from a seed, read with a limit on time and memory, and judged."""

import re
import shutil
import signal
import time
import traceback
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from random import Random
from types import FrameType
from typing import Any, NamedTuple

import numpy as np

from omninav.pipeline.graph.problems import BadInput, ProblemsFound
from omninav.pipeline.graph.value import Value

from .mutations import Files, Mutation

CPU_S = 1.0
"""Processor seconds that an input may take."""
MEMORY_BYTES = 300_000_000
"""How much the process may grow for an input."""
LINE = 1000
"""Characters of a message."""
MAX_INPUT = 10_000_000
"""Bytes of an input that is mutated further."""
MAX_STEPS = 4
"""Mutations of one input."""


class Wrong(AssertionError):
    """What a reader made of an input is neither a sound value nor one line."""


class TooSlow(BaseException):
    """The reader is still at work; no `except Exception` may swallow it."""


@dataclass(frozen=True)
class Format:
    """A format with good files of it, ways to damage them, and its reader.

    `samples`: good inputs, each the files of a folder. `read`: reads the folder and raises `Wrong` where the value is
    none; what it gives is searched for numbers that are not finite. `cases`: how many `make test` tries. `may_crash`:
    foreign code reads it that might end the process.
    """

    name: str
    samples: Callable[[], Sequence[Files]]
    mutations: Sequence[Mutation]
    read: Callable[[Path, Files], Any]
    cases: int = 200
    cpu_s: float = CPU_S
    may_crash: bool = False


class Case(NamedTuple):
    """An input by its seeds: which sample, and a seed for each mutation."""

    sample: int
    steps: tuple[int, ...]

    @classmethod
    def of(cls, seed: str, samples: int) -> "Case":
        """The case of a seed."""
        random = Random(seed)
        steps = tuple(random.getrandbits(32) for _ in range(random.choice((1, 1, 1, 2, 2, MAX_STEPS))))
        return cls(random.randrange(samples), steps)


def made(format: Format, case: Case) -> Files:
    """The files of a case."""
    files = format.samples()[case.sample]
    for step in case.steps:
        if sum(map(len, files.values())) > MAX_INPUT:
            break
        random = Random(step)
        with suppress(Exception):  # a mutation of what an earlier one has left unreadable
            files = random.choice(format.mutations)(random, files)
    return files


def judge(format: Format, case: Case, folder: Path) -> tuple[str, str]:
    """What becomes of a case: `accepted`, `refused` or `failed`, and the message."""
    return judge_files(format, made(format, case), folder)


def judge_files(format: Format, files: Files, folder: Path) -> tuple[str, str]:
    """What becomes of an input that lies in `folder` while it is read."""
    shutil.rmtree(folder, ignore_errors=True)
    for name, content in files.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(content)
    before, started = _reset_peak(), time.process_time()
    try:
        with _alarm(2 * format.cpu_s):
            not_finite(format.read(folder, files), format.name)
        ending = "accepted", ""
    except BadInput as error:
        ending = _in_one_line([str(error)])
    except ProblemsFound as error:
        ending = _in_one_line([str(problem).split("\n")[0] for problem in error.problems])
    except TooSlow:
        ending = "failed", "too slow: " + " < ".join(_frames(traceback.format_exc()))
    except MemoryError:
        ending = "failed", "MemoryError: " + " < ".join(_frames(traceback.format_exc()))
    except Exception as error:
        said = " ".join(str(error).split())[:200]
        ending = "failed", f"{type(error).__name__}: {said}: {' < '.join(_frames(traceback.format_exc()))}"
    took, grown = time.process_time() - started, _peak() - before
    if ending[0] != "failed" and took > format.cpu_s:
        return "failed", f"too slow: {took:.1f} s of CPU, then {ending[0]} {ending[1]}"
    if ending[0] != "failed" and grown > MEMORY_BYTES:
        return "failed", f"too large: {grown / 1e6:.0f} MB, then {ending[0]} {ending[1]}"
    return ending


@contextmanager
def within(cpu_s: float = CPU_S, memory_bytes: int = MEMORY_BYTES) -> Iterator[None]:
    """Raise where the block takes more processor time or memory, `TooSlow` while it is at work."""
    before, started = _reset_peak(), time.process_time()
    with _alarm(2 * cpu_s):
        yield
    took, grown = time.process_time() - started, _peak() - before
    if took > cpu_s or grown > memory_bytes:
        raise Wrong(f"it took {took:.1f} s of CPU and {grown / 1e6:.0f} MB")


def minimal(format: Format, case: Case, folder: Path) -> tuple[Case, str]:
    """A failing case with as few mutations as still fail, and its message."""
    message = judge(format, case, folder)[1]
    for number in reversed(range(len(case.steps))):
        fewer = Case(case.sample, case.steps[:number] + case.steps[number + 1 :])
        ending, said = judge(format, fewer, folder)
        if ending == "failed":
            case, message = fewer, said
    return case, message


def not_finite(thing: Any, where: str) -> None:
    """Raise `Wrong` where a number inside is not finite. Values, containers and arrays are searched."""
    if isinstance(thing, np.ndarray):
        if thing.dtype.kind == "f" and not np.isfinite(thing).all():
            raise Wrong(f"{where}: not finite")
    elif isinstance(thing, float | np.floating):
        if not np.isfinite(thing):
            raise Wrong(f"{where}: {thing}")
    elif isinstance(thing, dict):
        for key, item in thing.items():
            not_finite(item, f"{where}.{key}")
    elif isinstance(thing, list | tuple):
        for item in thing:
            not_finite(item, where)
    elif isinstance(thing, Value):
        not_finite(vars(thing), f"{where} {type(thing).__name__}")


def as_refused(said: str) -> None:
    """Raise what a command's refusal amounts to: `BadInput` where every line of it is one, else `Wrong`."""
    for line in said.split("\n"):
        if len(line) > LINE or re.search(r"[\x00-\x08\x0b-\x1f\x7f]", line) or "Traceback" in line:
            raise Wrong(f"{len(line)} characters, or not one line: {line[:200]!r}")
    raise BadInput(" ".join(said.split())[: LINE - 1] or "nothing")


def _in_one_line(parts: Sequence[str]) -> tuple[str, str]:
    for part in parts:
        if len(part) > LINE or re.search(r"[\x00-\x1f\x7f]", part):
            return "failed", f"{len(part)} characters, or not one line: {part[:200]!r}"
        if "Traceback" in part or not part.strip():
            return "failed", f"says nothing: {part[:200]!r}"
    return "refused", parts[0]


def _frames(trace: str) -> list[str]:
    """Where an error comes from, innermost first: the framework's own frames and the last one."""
    found = re.findall(r'File "([^"]+)", line (\d+), in (\S+)', trace)
    own = [f"{Path(file).name}:{line}" for file, line, _ in found if "omninav" in file or "/stages/" in file]
    last = f"{Path(found[-1][0]).name}:{found[-1][1]}" if found else "?"
    return [last, *[frame for frame in reversed(own) if frame != last][:3]]


@contextmanager
def _alarm(seconds: float) -> Iterator[None]:
    def ring(signum: int, frame: FrameType | None) -> None:
        raise TooSlow

    old = signal.signal(signal.SIGPROF, ring)
    signal.setitimer(signal.ITIMER_PROF, seconds, 0.5)  # again and again: the first may be swallowed in a destructor
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
        signal.signal(signal.SIGPROF, old)


def _reset_peak() -> int:
    with suppress(OSError):
        Path("/proc/self/clear_refs").write_text("5")
    return _peak()


def _peak() -> int:
    """The most memory this process has had since the last reset, bytes; 0 where the system does not say."""
    try:
        status = Path("/proc/self/status").read_bytes()
    except OSError:
        return 0
    return int(status.partition(b"VmHWM:")[2].split(None, 1)[0]) * 1000

"""Hostile inputs without end: make fuzz SECONDS=600 SEED=1

Each core takes the formats in turn, the one that has had the least time first. Every failing input is kept, cut down to
as few mutations as still fail, under tests/hostile/found, with its message and how to make it again.
"""

import argparse
import multiprocessing
import os
import resource
import shutil
import sys
import tempfile
import time
from collections import Counter
from datetime import date
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

from .formats import FORMATS
from .harness import Case, Format, judge, made, minimal

FOUND = Path(__file__).parent / "found"
ADDRESS_SPACE = 4_000_000_000
"""Bytes of a worker: an input that asks for more ends in a MemoryError, and the machine lives."""
ENDINGS = ("accepted", "refused", "failed")
LIFE_S = 240
"""Seconds of a worker: libraries lose some memory over images that they cannot read."""
KEPT = 200
"""Failing inputs that are written down."""


def main() -> int:
    """Fuzz for as long as asked and print a table; 1 where anything failed."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--seed", default="1")
    parser.add_argument("--formats", default="", help="only formats whose name holds this")
    given = parser.parse_args()
    formats = [format for format in FORMATS if given.formats in format.name]
    counts, failures = fuzz(formats, given.seconds, given.seed)
    print(table(formats, counts, given.seconds, given.seed))
    for message, (name, case) in sorted(failures.items())[:KEPT]:
        print(f"{name} {tuple(case)}: {message}")
    return int(bool(failures))


def fuzz(
    formats: list[Format], seconds: float, seed: str
) -> tuple[Counter[tuple[str, str]], dict[str, tuple[str, Case]]]:
    """Counts by format and ending, and failing cases by message."""
    counts: Counter[tuple[str, str]] = Counter()
    failures: dict[str, tuple[str, Case]] = {}
    end, workers = time.monotonic() + seconds, {}
    FOUND.mkdir(exist_ok=True)
    for number in range(os.cpu_count() or 1):
        workers[number] = _started(formats, f"{seed} {number}", end)
    starts, latest = len(workers), dict.fromkeys(workers, ("?", Case(0, ())))
    while workers:
        multiprocessing.connection.wait([pipe for _, pipe in workers.values()], timeout=1)
        for number, (process, pipe) in list(workers.items()):
            try:
                while pipe.poll():
                    kind, *content = pipe.recv()
                    if kind == "counts":
                        counts.update(content[0])
                    elif kind == "failure":
                        failures.setdefault(content[2], (content[0], Case(*content[1])))
                    latest[number] = (content[0], Case(*content[1])) if kind == "now" else ("?", Case(0, ()))
            except EOFError:
                process.join()
                del workers[number]
                if process.exitcode:
                    message = f"the process ended with {process.exitcode}"
                    failures.setdefault(f"{message} in {latest[number]}", latest[number])
                if time.monotonic() < end:
                    starts += 1
                    workers[number] = _started(formats, f"{seed} {starts}", end)
    return counts, failures


def table(formats: list[Format], counts: Counter[tuple[str, str]], seconds: float, seed: str) -> str:
    """What became of all cases, as a table of a page."""
    head = ("format", "cases", *ENDINGS)
    rows = [(one.name, [counts[one.name, ending] for ending in ENDINGS]) for one in formats]
    rows.append(("all", [sum(numbers[column] for _, numbers in rows) for column in range(len(ENDINGS))]))
    lines = [f"{date.today()}, seed {seed}, {seconds:.0f} s on {os.cpu_count()} cores:", ""]
    lines += [f"| {' | '.join(head)} |", f"|---|{'---:|' * (len(head) - 1)}"]
    lines += [f"| {name} | {sum(numbers):,} | {' | '.join(f'{n:,}' for n in numbers)} |" for name, numbers in rows]
    return "\n".join(lines)


def _started(formats: list[Format], seed: str, end: float) -> tuple[Any, Connection]:
    mine, theirs = multiprocessing.get_context("spawn").Pipe(duplex=False)
    process = multiprocessing.get_context("spawn").Process(
        target=_work, args=([format.name for format in formats], seed, end, theirs), daemon=True
    )
    process.start()
    theirs.close()
    return process, mine


def _work(names: list[str], seed: str, end: float, pipe: Connection) -> None:
    resource.setrlimit(resource.RLIMIT_AS, (ADDRESS_SPACE, ADDRESS_SPACE))
    with (FOUND / f"worker_{seed.replace(' ', '_')}.log").open("w") as said:  # image libraries complain of every image
        os.dup2(said.fileno(), 2)
    formats = [format for format in FORMATS if format.name in names]
    spent = dict.fromkeys(names, 0.0)
    tried: Counter[str] = Counter()
    for format in formats:
        format.samples()  # made once, in no format's time
    known: set[str] = set()
    with tempfile.TemporaryDirectory(dir="/dev/shm" if os.access("/dev/shm", os.W_OK) else None) as scratch:
        folder = Path(scratch, "input")
        os.chdir(scratch)
        retired = min(end, time.monotonic() + LIFE_S)
        while time.monotonic() < retired:
            format = min(formats, key=lambda format: spent[format.name])
            counts: Counter[tuple[str, str]] = Counter()
            started = time.monotonic()
            while time.monotonic() < min(started + 1, end):
                case = Case.of(f"{seed} {format.name} {tried[format.name]}", len(format.samples()))
                tried[format.name] += 1
                if format.may_crash:
                    pipe.send(("now", format.name, tuple(case)))
                ending, message = judge(format, case, folder)
                counts[format.name, ending] += 1
                if ending == "failed" and message not in known:
                    known.add(message)
                    case, message = minimal(format, case, folder)
                    pipe.send(("failure", format.name, tuple(case), message))
                    if message not in known or len(known) < KEPT:
                        _keep(format, case, message)
                    known.add(message)
            spent[format.name] += time.monotonic() - started
            pipe.send(("counts", counts))


def _keep(format: Format, case: Case, message: str) -> None:
    place = FOUND / f"{format.name.replace(' ', '_')}_{'_'.join(map(str, (case.sample, *case.steps)))}"
    shutil.rmtree(place, ignore_errors=True)
    for name, content in made(format, case).items():
        (place / name).parent.mkdir(parents=True, exist_ok=True)
        (place / name).write_bytes(content)
    (place / "MESSAGE").write_text(f"{message}\n")


if __name__ == "__main__":
    sys.exit(main())

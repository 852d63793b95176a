"""`make mutants`: whether the tests notice a slip in the code that judges, fuses and maps.

A mutant is the code with one slip: a limit that is compared the other way, a sum in place of a difference, the least in
place of the largest, another number. Each is tried in a copy of the repository, by the tests of its folder that reach
its line; it is killed where one of them fails, or does not end. Printed for each folder: how many were tried, how many
were killed, the share with its 95 % interval, and every survivor. Exit status 1 where a folder has less than 90 %.

    make mutants                     a sample of 60 from each folder (SAMPLE=60 SEED=1)
    make mutants ALL=1               all of them
    make mutants ONLY=stages/fusion  of a folder or a file; TESTS=tests/…: by fewer tests

Not counted: what equivalent.txt lists with a reason, error messages, types, and how pages name a figure.
"""

import argparse
import os
import pickle
import random
import shutil
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from scipy.stats import binomtest

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE))

from mutations import Mutant, mutants  # noqa: E402
from session import MutantSession, ends_after, printed_to  # noqa: E402

REPOSITORY = HERE.parents[1]
FOLDERS = {
    "stages/metrics": ("*", "tests/stages/metrics"),
    "pipeline/experiment": ("verdicts intervals series claims specification", "tests/pipeline/experiment"),
    "stages/fusion": ("*", "tests/stages/fusion"),
    "stages/mapping": ("*", "tests/stages/mapping"),
}
"""Which files are changed, and where the tests are that must notice it."""
ENOUGH = 0.90
LEFT_OUT = (".git", ".venv*", "build", "runs", "site", "__pycache__", ".*_cache", ".hypothesis", "node_modules")
OPTIONS = "-x -s --import-mode=importlib -p no:cacheprovider -p no:xdist -p no:anyio"
PYTEST = ("-o", "addopts=" + OPTIONS)
UNIMPORTED_S = 60
"""How long the tests of a mutant may work that is imported anew."""
Ends = dict[Mutant, tuple[str, list[str]]]
"""What became of each mutant, and the tests that were asked."""


def main() -> int:
    """Try them, and print what became of them."""
    words = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    words.add_argument("only", nargs="*", help="folders or files")
    words.add_argument("--tests", help="a test file, in place of the folder's")
    words.add_argument("--all", action="store_true", help="all mutants in place of a sample")
    words.add_argument("--sample", type=int, default=60, help="mutants of each folder")
    words.add_argument("--seed", type=int, default=1)
    words.add_argument("--jobs", type=int, default=os.cpu_count() or 1, help="processes at a time")
    asked = words.parse_args()
    preload()
    poor = []
    with copies(asked.jobs) as places:
        files = files_of(asked.only)
        found = {file: mutants(places[0], file) for each in files.values() for file in each}
        counts = without_equivalent(found)
        for folder, names in files.items():
            tests = FOLDERS[folder][1]
            counted = [mutant for file in names for mutant in counts[file]]
            tried = counted
            if not asked.all and len(counted) > asked.sample:
                tried = random.Random(asked.seed).sample(counted, asked.sample)
            tried = sorted(tried, key=lambda each: (each.file, each.line))
            began = time.monotonic()
            ends = in_session(tried, asked.tests or tests, places[0], asked.jobs)
            ends |= imported_anew({each: tests for each, (end, tests) in ends.items() if end == "import"}, places)
            share = told(folder, len(counted), ends, time.monotonic() - began)
            if share < ENOUGH:
                poor.append(folder)
    if poor:
        print(f"below {ENOUGH:.0%}: {', '.join(poor)}; a test that notices, or simpler code, kills a survivor")
    return 1 if poor else 0


def preload() -> None:
    """Import once what all mutants import of other people, and nothing of ours."""
    import cv2, hydra, hypothesis, jinja2, networkx, numba, poselib, pyarrow, rich  # noqa: E401, F401, I001
    import matplotlib.pyplot, scipy.ndimage, scipy.optimize, scipy.spatial  # noqa: E401, F401


@contextmanager
def copies(number: int) -> Iterator[list[Path]]:
    """Copies of the repository, in which mutants are written."""
    with tempfile.TemporaryDirectory(prefix="omninav-mutants-") as place:
        made = [Path(place).resolve() / str(k) for k in range(number)]
        for copy in made:
            shutil.copytree(REPOSITORY, copy, symlinks=True, ignore=shutil.ignore_patterns(*LEFT_OUT))
        yield made


def files_of(only: list[str]) -> dict[str, list[str]]:
    """The files of each folder, of those that are asked for."""
    found = {}
    for folder, (names, _) in FOLDERS.items():
        paths = [path for name in names.split() for path in (REPOSITORY / folder).glob(f"{name}.py")]
        files = sorted(f"{folder}/{path.name}" for path in paths)
        found[folder] = [file for file in files if not only or file.startswith(tuple(only))]
    return {folder: files for folder, files in found.items() if files}


def without_equivalent(found: dict[str, list[Mutant]]) -> dict[str, list[Mutant]]:
    """Those of each file that equivalent.txt does not list. Entries that are no mutant any more end the program."""
    blocks = [block.splitlines() for block in (HERE / "equivalent.txt").read_text().split("\n\n")[1:]]
    listed = {(file, before.strip(), after.strip()): because for file, before, after, because in blocks}
    known = {(each.file, each.before, each.after) for mutants in found.values() for each in mutants}
    stale = [" | ".join(entry) for entry in listed if entry[0] in found and entry not in known]
    if stale:
        raise SystemExit("\n".join(["equivalent.txt lists what is no mutant:", *stale]))
    return {
        file: [each for each in mutants if (each.file, each.before, each.after) not in listed]
        for file, mutants in found.items()
    }


def in_session(tried: list[Mutant], tests: str, place: Path, jobs: int) -> Ends:
    """Try mutants in one session of pytest; "import" is the end of those that only a new import shows."""
    kept, log = place / "ends.pickle", place / "session.log"
    terminal = os.dup(1)
    child = os.fork()
    if child == 0:
        status = 1
        try:
            enter(place)
            printed_to(log)
            session = MutantSession(place, tried, jobs, lambda each, tests: os.write(terminal, survives(each, tests)))
            status = int(pytest.main([*PYTEST, tests], plugins=[session]))
            kept.write_bytes(pickle.dumps({each: (session.ends[each], session.asked[each]) for each in tried}))
        finally:
            os._exit(status)  # the copies are the other process's to remove
    os.close(terminal)
    if os.waitpid(child, 0)[1]:
        raise SystemExit(f"{tests}: without any change, pytest ends with\n{log.read_text()}")
    ends: Ends = pickle.loads(kept.read_bytes())
    return ends


def imported_anew(asked: dict[Mutant, list[str]], places: list[Path]) -> Ends:
    """Try each mutant in a process that imports our code anew, with the change in its file."""
    ends: Ends = {}
    originals = {each.file: (places[0] / each.file).read_text() for each in asked}
    free = list(places)
    running: dict[int, tuple[Mutant, Path]] = {}
    waiting = list(asked)
    while waiting or running:
        if waiting and free:
            mutant, place = waiting.pop(), free.pop()
            written(mutant.source(originals[mutant.file]), place / mutant.file, len(waiting))
            running[asked_of(asked[mutant], place)] = mutant, place
            continue
        child, status = os.wait()
        mutant, place = running.pop(child)
        (place / mutant.file).write_text(originals[mutant.file])
        free.append(place)
        ends[mutant] = ("survived" if status == 0 else "killed", asked[mutant])
        if status == 0:
            os.write(1, survives(mutant, asked[mutant]))
    return ends


def written(source: str, file: Path, number: int) -> None:
    """Write a mutant's file, with a time of its own: by that Python tells whether its compiled file is of this one."""
    file.write_text(source)
    os.utime(file, (number, number))


def asked_of(tests: list[str], place: Path) -> int:
    """Start tests in a process that imports our code from a place; the process."""
    child = os.fork()
    if child:
        return child
    enter(place)
    sys.dont_write_bytecode = True
    printed_to(Path(os.devnull))
    ends_after(UNIMPORTED_S)
    os._exit(int(pytest.main([*PYTEST, *tests])))


def enter(place: Path) -> None:
    """Let this process, and those that it starts, import our code from a copy."""
    os.chdir(place)
    sys.path.insert(0, str(place))
    os.environ |= {"PYTHONPATH": str(place), "MPLBACKEND": "agg"}


def survives(mutant: Mutant, tests: list[str]) -> bytes:
    """A survivor, as it is printed."""
    return f"{mutant}\n    {f'survives {len(tests)} tests' if tests else 'is reached by no test'}\n".encode()


def told(folder: str, counted: int, ends: Ends, seconds: float) -> float:
    """Print the share that was killed; the share."""
    killed = sum(end == "killed" for end, _ in ends.values())
    low, high = binomtest(killed, len(ends)).proportion_ci(method="wilson")
    of = "all" if len(ends) == counted else f"{len(ends)} of {counted}"
    print(
        f"{folder}: {killed / len(ends):.1%} killed ({killed} of {len(ends)}; 95 % interval {low:.1%} to {high:.1%}; "
        f"{of} mutants, {seconds:.0f} s)",
        flush=True,
    )
    return killed / len(ends)


if __name__ == "__main__":
    sys.exit(main())

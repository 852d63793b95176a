"""`make kills`: runs that are disturbed at random moments, again and again, end at the bytes of an undisturbed one.

Every variant, `simulate`, a sweep and an experiment run in fresh interpreters on the recordings of tests/data. Each is
killed (SIGKILL), told to end (SIGTERM), interrupted (SIGINT), stopped for a while (SIGSTOP), run on a disk that is full
(no file may grow beyond a size) and with a clock that is set back, some three times before it may end; whoever was
stopped is resumed, or typed again where nothing could be resumed yet. Then `omninav resume` is started twice at once.
Printed for each: how often it was disturbed, how many runs gave other bytes, how many processes showed a traceback, and
how many second owners were refused. Exit status 1 where anything differs.

    make kills KILLS=300 PAIRS=20 SEED=0        (or ONLY=homing,sweep for some of them)
"""

import hashlib
import json
import os
import random
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE), str(HERE.parents[1]), str(HERE.parent / "variants")]

from disturbances import KINDS, Ended, Workplace  # noqa: E402
from golden_figures import DRIVE, RUNS, TOUR, started_by, write_goal  # noqa: E402

TIMES = ("report.html", "timing.json", "config.yaml", "sweep.html", "manifest.json", "run.log", "multirun.yaml")
"""Files that hold times or places."""
PER_RUN = 3
"""Disturbances before a run may end."""
EXPERIMENT = f"""\
# @package experiment
name: matching
title: Matching of whole views
about: Whether a killed experiment ends with the same figures.
variant: plain_matching
set: {TOUR} {DRIVE}
sweep:
  size: {{few: nodes.source.stop=20, more: nodes.source.stop=30}}
  stride: {{third: nodes.source.stride=3, fourth: nodes.source.stride=4}}
repetitions: 2
measures:
  error: {{title: Error (m), path: [position_error_m.median]}}
page: {{rows: [size], columns: stride}}
"""


@dataclass
class Case:
    """Something that is run, disturbed, and run again."""

    name: str
    words: tuple[str, ...]
    resumes: bool = True
    """Whether `omninav resume` goes on with it; else its command is typed again."""
    whole: dict[str, str] = field(default_factory=dict)
    """The hashes of the files of the undisturbed run."""
    seconds: float = 0.0
    kills: int = 0
    runs: int = 0
    differing: int = 0
    tracebacks: int = 0
    refused: int = 0
    notes: list[str] = field(default_factory=list)


def cases() -> Iterator[Case]:
    """All that is disturbed."""
    kept = ("runs=runs", "cache=cache", "seed=0", "checkpoint_s=0.05")
    for name in sorted(RUNS):
        if name == "simulate":
            yield Case(name, started_by(name), resumes=False)
        else:
            yield Case(name, (*started_by(name), *kept))
    swept = ("variant=plain_matching", TOUR, DRIVE, "nodes.source.stride=3", *kept[1:2], "checkpoint_s=0.05")
    yield Case("sweep", ("-m", *swept, "seed=0,1", "hydra.sweep.dir=runs/swept"), resumes=False)
    yield Case("experiment", ("--config-dir", "mine", "+experiment=matching", *kept[:2]), resumes=False)


def result(folder: Path) -> dict[str, str]:
    """What is compared: the hashes of files that hold neither times nor places, and an experiment's figures."""
    found = {}
    for file in sorted(folder.rglob("*")):
        name = str(file.relative_to(folder))
        if not file.is_file() or file.is_symlink() or name.split("/")[0] in ("cache", "site", "mine"):
            continue
        if file.name in TIMES or file.suffix in (".lock", ".log", ".html", ".part") or "/." in f"/{name}":
            continue
        if file.name.startswith("seed_"):
            content = json.dumps(json.loads(file.read_text())["metrics"], sort_keys=True).encode()
        elif file.name.startswith(("experiment", "matching")):
            continue
        else:
            content = file.read_bytes()
        found["/".join(part for part in name.split("/") if not part.startswith("20"))] = hashlib.sha256(
            content
        ).hexdigest()
    return found


def manifests(folder: Path) -> dict[Path, int]:
    """When each manifest was written (ns). A run may move its folder meanwhile."""
    found = {}
    for place, _, files in os.walk(folder / "runs"):
        if "manifest.json" in files:
            with suppress(FileNotFoundError):
                found[Path(place)] = (Path(place) / "manifest.json").stat().st_mtime_ns
    return found


class Campaign:
    """Disturbs one case in folders of its own."""

    def __init__(self, case: Case, place: Path, seed: int) -> None:
        self.case, self.place, self.chance = case, place, random.Random(f"{case.name} {seed}")

    def undisturbed(self) -> bool:
        """The run whose bytes all others have to give; whether it ended well."""
        workplace = self.workplace("whole")
        began = time.monotonic()
        process = workplace.start(self.case.words)
        while process.poll() is None and not self.begun(workplace):
            time.sleep(0.02)
        began = time.monotonic()
        output, _ = process.communicate()
        self.case.seconds = time.monotonic() - began
        if process.returncode:
            self.case.differing += 1
            self.case.notes.append(f"{self.case.name}: undisturbed it ended with {process.returncode}\n{output}")
        self.case.whole = result(workplace.folder)
        return process.returncode == 0

    def workplace(self, name: str) -> Workplace:
        """An empty folder."""
        folder = self.place / self.case.name / name
        shutil.rmtree(folder, ignore_errors=True)
        (folder / "mine" / "experiment").mkdir(parents=True)
        (folder / "mine" / "experiment" / "matching.yaml").write_text(EXPERIMENT)
        write_goal(folder)
        return Workplace(folder)

    def begun(self, workplace: Workplace) -> bool:
        """Whether anything can be lost."""
        return any(workplace.folder.glob("runs/**/manifest.json")) or any(workplace.folder.glob("*.part"))

    def next_words(self, workplace: Workplace) -> tuple[str, ...]:
        """How one goes on."""
        latest = workplace.folder / "runs" / "latest"
        return ("resume", "runs/latest") if self.case.resumes and latest.exists() else self.case.words

    def moment(self, workplace: Workplace) -> Callable[[subprocess.Popen[str]], None]:
        """Some moment of a run; in one case of five, one before anything can be lost."""

        def wait(process: subprocess.Popen[str]) -> None:
            deadline = time.monotonic() + (self.chance.uniform(0.0, 3.0) if self.chance.random() < 0.2 else 300.0)
            known = manifests(workplace.folder)
            while process.poll() is None and time.monotonic() < deadline:
                if manifests(workplace.folder) != known or (not self.case.resumes and self.begun(workplace)):
                    time.sleep(self.chance.uniform(0.0, self.case.seconds))
                    return
                time.sleep(0.02)

        return wait

    def note(self, ended: Ended, kind: str) -> None:
        """Whether a process said what it should not."""
        if ended.traceback:
            self.case.tracebacks += 1
            self.case.notes.append(f"{self.case.name}, {kind}: {ended.output[-2000:]}")

    def compare(self, workplace: Workplace, what: str) -> None:
        """Whether a run gave the bytes of the undisturbed one."""
        found = result(workplace.folder)
        other = sorted(name for name in {*found, *self.case.whole} if found.get(name) != self.case.whole.get(name))
        if other:
            self.case.differing += 1
            kept = self.place.parent / "differing" / f"{self.case.name}_{self.case.runs}"
            shutil.copytree(workplace.folder, kept, symlinks=True, dirs_exist_ok=True)
            self.case.notes.append(f"{self.case.name}, {what}: other bytes in {', '.join(other)}; kept in {kept}")

    def run(self, kills: int, pairs: int) -> Case:
        """All of it."""
        kills, pairs = (kills, pairs) if self.undisturbed() else (0, 0)
        while self.case.kills < kills:
            self.case.runs += 1
            workplace, done = self.workplace("disturbed"), []
            while len(done) < PER_RUN:
                kind = self.chance.choice(KINDS)
                ended = workplace.disturb(self.next_words(workplace), kind, self.moment(workplace))
                self.note(ended, kind)
                done.append(f"{kind} ({ended.code})")
                self.case.kills += ended.disturbed
            last = workplace.run(self.next_words(workplace))
            self.note(last, "at the end")
            if last.code:
                done.append(f"ended with {last.code}: {last.output[-500:]}")
            self.compare(workplace, ", ".join(done))
        for _ in range(pairs):
            self.pair()
        return self.case

    def pair(self) -> None:
        """`resume` twice at once, of a run that was killed."""
        self.case.runs += 1
        workplace = self.workplace("twice")
        for _ in range(20):
            workplace.disturb(self.next_words(workplace), "SIGKILL", self.moment(workplace))
            self.case.kills += 1
            latest = workplace.folder / "runs" / "latest"
            if latest.exists():
                break
        both = [workplace.start(("resume", "runs/latest")) for _ in range(2)]
        ends = [(process.communicate()[0], process.returncode) for process in both]
        self.case.refused += sum("is running it" in output and code == 2 for output, code in ends)
        owners = sum(code == 0 for _, code in ends)
        late = sum("was complete" in output for output, _ in ends)
        if owners - late > 1 or not owners:
            self.case.differing += 1
            self.case.notes.append(f"{self.case.name}: {owners} owners at once: {ends}")
        self.compare(workplace, "two resumes at once")


def table(found: list[Case]) -> str:
    """What is printed."""
    head = f"{'':28}{'kills':>7}{'runs':>7}{'differing':>11}{'tracebacks':>12}{'refused':>9}"
    rows = [
        f"{case.name:28}{case.kills:7}{case.runs:7}{case.differing:11}{case.tracebacks:12}{case.refused:9}"
        for case in found
    ]
    total = [
        sum(getattr(case, name) for case in found) for name in ("kills", "runs", "differing", "tracebacks", "refused")
    ]
    return "\n".join([head, *rows, f"{'all':28}{total[0]:7}{total[1]:7}{total[2]:11}{total[3]:12}{total[4]:9}"])


def main() -> int:
    """Disturb everything, print the table, and say whether anything went wrong."""
    kills, pairs = int(os.environ.get("KILLS", "300")), int(os.environ.get("PAIRS", "20"))
    seed, only = int(os.environ.get("SEED", "0")), os.environ.get("ONLY", "")
    chosen = [case for case in cases() if not only or case.name in only.split(",")]
    twice = [case for case in chosen if case.resumes]
    share = {case.name: pairs // len(twice) + (number < pairs % len(twice)) for number, case in enumerate(twice)}
    place = Path(tempfile.mkdtemp(prefix="kills_"))
    done: list[Case] = []

    def one(case: Case) -> None:
        campaign = Campaign(case, place / "work", seed)
        campaign.run(-(-(kills - pairs) // len(chosen)), share.get(case.name, 0))
        done.append(case)
        print(table([case]).split("\n")[1], *case.notes, sep="\n", flush=True)
        shutil.rmtree(place / "work" / case.name, ignore_errors=True)

    with ThreadPoolExecutor(len(os.sched_getaffinity(0))) as pool:
        list(pool.map(one, chosen))
    found = sorted(done, key=lambda case: case.name)
    print(f"seed {seed}\n{table(found)}")
    return 1 if any(case.differing or case.tracebacks for case in found) else 0


if __name__ == "__main__":
    sys.exit(main())

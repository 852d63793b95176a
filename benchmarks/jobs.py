"""What a job costs beside its own work, and what a second worker brings."""

import json
import statistics
import tempfile
import time
from pathlib import Path
from typing import Any

import omninav
from omninav.pipeline.experiment.repetition import condition_key
from omninav.pipeline.jobs.executors import ExecutorSettings
from omninav.pipeline.jobs.job import Job
from omninav.pipeline.jobs.worker_pool import WorkerPool

from .table import Row

DATA = Path(__file__).resolve().parents[1] / "tests" / "data"
EMPTY = 200
REPETITIONS = 40
ROUNDS = 3


def rows() -> list[Row]:
    """Empty tasks; forty repetitions of `omniview_mcl` with 5000 particles on one worker and on two, in turns."""
    with tempfile.TemporaryDirectory() as place:
        return [*_overhead(Path(place) / "empty"), *_throughput(Path(place) / "repetitions")]


def _overhead(place: Path) -> list[Row]:
    jobs = [Job(str(n), "benchmarks.cluster.tasks:nothing", {}, place / f"{n}.log") for n in range(EMPTY)]
    with WorkerPool(ExecutorSettings(workers=1), place) as workers:
        workers.run(jobs[:5])
        times = []
        for _ in range(ROUNDS):
            begun = time.perf_counter()
            workers.run(jobs)
            times.append((time.perf_counter() - begun) / EMPTY)
    return [Row("overhead of a task, executor=local", 1e3 * statistics.median(times), "ms", limit=20.0)]


def _throughput(place: Path) -> list[Row]:
    words: dict[str, Any] = {"tour": str(DATA / "tour.mcap"), "log": str(DATA / "drive.mcap"), "plots": "none"}
    made = omninav.compose("omniview_mcl", cache=str(place / "cache"), **words, **{"nodes.prior.number": 5000})
    given = {
        "config": json.loads(json.dumps(made.prepared.config, default=str)),
        "key": condition_key(made.prepared),
        "code": made.prepared.digest,
        "shared": True,
        "groups": [],
    }
    used = 0

    def jobs(workers: int, number: int) -> list[Job]:
        nonlocal used
        found = []
        for part in range(workers):
            seeds = list(range(used, used + number // workers))
            used += len(seeds)
            folder = place / f"{used}_{part}"
            own = {**given, "folder": str(folder), "part": "part", "seeds": seeds}
            found.append(Job(folder.name, "benchmarks.cluster.tasks:repeat", own, folder / "log"))
        return found

    times: dict[int, list[float]] = {1: [], 2: []}
    processor: dict[int, list[float]] = {1: [], 2: []}
    settings = [ExecutorSettings(workers=number) for number in (1, 2)]
    with WorkerPool(settings[0], place) as one, WorkerPool(settings[1], place / "two") as two:
        pools = {1: one, 2: two}
        for number, workers in pools.items():  # map, features and compiled code are there by then
            ends = workers.run(jobs(number, 2))
            assert not any(end.error for end in ends.values()), ends
        for _ in range(ROUNDS):
            for number, workers in pools.items():
                workers.run(jobs(number, number))  # its processes are there
                some = jobs(number, REPETITIONS)
                begun = time.perf_counter()
                ends = workers.run(some)
                times[number].append(time.perf_counter() - begun)
                processor[number].append(max(end.value for end in ends.values()))
    alone, both = (statistics.median(times[number]) for number in (1, 2))
    busy = {number: statistics.median(taken) for number, taken in processor.items()}
    what, peer = f"{REPETITIONS} repetitions: 1 worker's processor time", "the busier of 2 workers"
    return [
        Row("repetitions/s on 1 worker", REPETITIONS / alone, "1/s"),
        Row("repetitions/s on 2 workers", REPETITIONS / both, "1/s", "1 worker", REPETITIONS / alone),
        Row(what, busy[1], "s", peer, busy[2], limit=1.9, of_peer=True, higher_is_better=True),
    ]

"""Twelve jobs, of which one always raises, one always dies and one dies once, on what might run them.

`python benchmarks/cluster/twelve_jobs.py [NAME …]` prints a row for each. A library's own executor is given the bare
functions (its retries on, where it has any); ours the same functions as jobs. With Slurm: inside `one_node_slurm.py`.
"""

import importlib.metadata
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, Future, ProcessPoolExecutor, wait
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from benchmarks.cluster.tasks import task

KINDS = ["well"] * 4 + ["raises", "dies", "dies once"] + ["well"] * 5
PATIENCE_S = 90.0
EMPTY = 50
"""Tasks that take no time, for what each costs."""


class Ours:
    """Our jobs, handed to an engine."""

    def __init__(self, **engine: Any) -> None:
        from omninav.pipeline.jobs.executors import read_engine

        self._settings = read_engine(engine)

    def __call__(self, kinds: list[str], marks: list[str], folder: Path) -> list[str]:
        from omninav.pipeline.jobs.job import Job
        from omninav.pipeline.jobs.run import Workers

        jobs = [
            Job(str(n), "benchmarks.cluster.tasks:job", {"kind": kind, "mark": mark}, folder / f"{n}.log")
            for n, (kind, mark) in enumerate(zip(kinds, marks, strict=True))
        ]
        with Workers(self._settings, folder) as workers:
            workers.run([*jobs[:1], replace(jobs[0], name="second")])  # started
            self.begun = time.monotonic()
            ended = workers.run(jobs)
            self.ended = time.monotonic()
        outcomes = [ended[job.name] for job in jobs]
        return ["raised" if "ValueError" in (o.error or "") else "died" if o.died else "well" for o in outcomes]


class Theirs:
    """A library's executor, given the bare function."""

    def __init__(self, make: Callable[[], Any]) -> None:
        self._make = make

    def __call__(self, kinds: list[str], marks: list[str], folder: Path) -> list[str]:
        with self._make() as executor:
            executor.submit(task, "well", "").result(PATIENCE_S)
            self.begun = time.monotonic()
            futures: list[Future[str] | BaseException] = []
            for kind, mark in zip(kinds, marks, strict=True):
                try:
                    futures.append(executor.submit(task, kind, mark))
                except Exception as error:
                    futures.append(error)
            wait([each for each in futures if isinstance(each, Future)], timeout=PATIENCE_S)
            self.ended = time.monotonic()
            return [_end(each) for each in futures]


def _end(future: "Future[str] | BaseException") -> str:
    if not isinstance(future, Future):
        return "lost"
    if not future.done():
        return "never ends"
    if future.cancelled():
        return "lost"
    error = future.exception()
    return "well" if error is None else "raised" if isinstance(error, ValueError) else "died"


@contextmanager
def _dask() -> Iterator[Executor]:
    from distributed import Client, LocalCluster

    with LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster, Client(cluster) as client:
        yield client.get_executor(pure=False, retries=2)


@contextmanager
def _dask_address() -> Iterator[str]:
    from distributed import LocalCluster

    with LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster:
        yield cluster.scheduler_address


def _executorlib(**how: Any) -> Any:
    import executorlib

    return executorlib.SingleNodeExecutor(max_workers=2, **how)


def _executorlib_slurm(**how: Any) -> Any:
    import executorlib

    folder = tempfile.mkdtemp()
    return executorlib.SlurmClusterExecutor(
        cache_directory=folder, resource_dict={"cores": 1, "partition": "short"}, **how
    )


def _submitit(cluster: str) -> Any:
    import submitit

    executor = submitit.AutoExecutor(folder=tempfile.mkdtemp(), cluster=cluster)
    executor.update_parameters(timeout_min=5)
    return executor


CANDIDATES: dict[str, Callable[[], Any]] = {
    "ProcessPoolExecutor": lambda: Theirs(lambda: ProcessPoolExecutor(2)),
    "executorlib, local": lambda: Theirs(lambda: _executorlib()),
    "executorlib, local, workers kept": lambda: Theirs(lambda: _executorlib(block_allocation=True)),
    "executorlib, local, workers kept, 2 restarts": lambda: Theirs(
        lambda: _executorlib(block_allocation=True, restart_limit=2)
    ),
    "executorlib, Slurm": lambda: Theirs(lambda: _executorlib_slurm()),
    "Dask, local": lambda: Theirs(_dask),
    "omninav, engine=local": lambda: Ours(name="local", workers=2),
    "omninav, engine=dask": lambda: Ours(name="dask", address=os.environ["DASK_ADDRESS"]),
    "omninav, engine=slurm": lambda: Ours(name="slurm", workers=2, memory="1GB"),
}


def measured(name: str) -> str:
    """A row of the table."""
    candidate = CANDIDATES[name]()
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as place:
        folder = Path(place)
        marks = [str(folder / f"mark{n}") for n in range(len(KINDS))]
        ends = candidate(KINDS, marks, folder)
        seconds = candidate.ended - candidate.begun
        innocent = [end for kind, end in zip(KINDS, ends, strict=True) if kind == "well" and end != "well"]
        of = dict(zip(KINDS, ends, strict=True))
        candidate(["well"] * EMPTY, [""] * EMPTY, folder)
        each = 1e3 * (candidate.ended - candidate.begun) / EMPTY
    words = [
        of["raises"],
        of["dies"],
        of["dies once"],
        f"{len(innocent)} of 9" + (f" ({innocent[0]})" if innocent else ""),
    ]
    return f"| {name} | {' | '.join(words)} | {seconds:.1f} | {each:.1f} |"


def main() -> None:
    """Print the rows of what was named, each from a process of its own, so that none disturbs the next."""
    names = sys.argv[1:] or list(CANDIDATES)
    if len(names) == 1:
        print(measured(names[0]), flush=True)
        os._exit(0)  # whatever still runs
    for package in ("executorlib", "pysqa", "distributed", "dask-jobqueue"):
        try:
            print(f"{package} {importlib.metadata.version(package)}")
        except importlib.metadata.PackageNotFoundError:
            print(f"{package}: not installed")
    print("\n| on what | raises | dies | dies once | innocent lost | seconds | ms per empty task |")
    print("|---|---|---|---|---|---:|---:|", flush=True)
    for name in names:
        try:
            with _dask_address() if name.endswith("dask") else _nothing() as address:
                environment = {**os.environ, "DASK_ADDRESS": address}
                words = [sys.executable, __file__, name]
                ended = subprocess.run(words, capture_output=True, text=True, timeout=4 * PATIENCE_S, env=environment)
            row = [line for line in ended.stdout.splitlines() if line.startswith("|")]
            print(row[0] if row else f"| {name} | {ended.stderr.strip().splitlines()[-1]:.120} |", flush=True)
        except subprocess.TimeoutExpired:
            print(f"| {name} | did not come to an end within {4 * PATIENCE_S:.0f} s |", flush=True)


@contextmanager
def _nothing() -> Iterator[str]:
    yield ""


if __name__ == "__main__":
    main()

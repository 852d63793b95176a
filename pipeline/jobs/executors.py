"""Executors, which run jobs: factories of a `concurrent.futures.Executor`, found by their names."""

import os
import re
from collections.abc import Callable, Mapping
from concurrent.futures import Executor, ThreadPoolExecutor
from dataclasses import dataclass, field
from importlib import import_module
from importlib.metadata import entry_points
from pathlib import Path
from typing import Any

from omninav.pipeline.graph.problems import BadInput, Problem, ProblemsFound, suggest

ENTRY_POINTS = "omninav.executors"
"""The group in which installed packages offer executors of their own."""
BUILT_IN = {
    "local": "omninav.pipeline.jobs.executors:local",
    "slurm": "omninav.pipeline.jobs.dask_executor:slurm",
    "dask": "omninav.pipeline.jobs.dask_executor:dask_cluster",
}
WORD = re.compile(r"[\w.,:@/+-]{1,200}")
"""Pattern of what may be written into a batch script."""


@dataclass(frozen=True)
class ExecutorSettings:
    """Settings under `executor.…`."""

    name: str = "local"
    workers: int | None = None
    """Jobs at a time. None: local, one for each core; dask, as many as the cluster has; slurm, 4."""
    memory: int | None = None
    """Bytes that a job may take; None: as many as there are."""
    options: Mapping[str, Any] = field(default_factory=dict)
    """Options of this executor alone."""
    folder: Path | None = None
    """Folder for what an executor's workers print; all machines see it."""


Factory = Callable[[ExecutorSettings], Executor]


def read_executor(plain: Any) -> ExecutorSettings:
    """Read the settings of an executor from a configuration. Raises `ProblemsFound`."""
    given: dict[str, Any] = {"name": plain} if isinstance(plain, str) else dict(plain or {})
    name, workers, memory = (given.pop(key, None) for key in ("name", "workers", "memory"))
    name = "local" if name is None else name
    problems = []
    known = _factories()
    if name not in known:
        hint = suggest(str(name), known, "executors")
        problems.append(Problem("executor", f"there is no executor '{name!s:.40}'", hint))
    if workers is not None and (not isinstance(workers, int) or isinstance(workers, bool) or not 1 <= workers <= 1e5):
        what = f"{workers!r:.40}, expected a whole number >= 1"
        problems.append(Problem("executor.workers", what, "type executor.workers=4"))
    size = None if memory is None else _bytes(memory)
    if memory is not None and size is None:
        what = f"{memory!r:.40}, expected a size with its unit"
        problems.append(Problem("executor.memory", what, "type executor.memory=4GB"))
    if problems:
        raise ProblemsFound(problems)
    return ExecutorSettings(name, workers, size, given)


def _bytes(text: Any) -> int | None:
    found = re.fullmatch(r"(\d{1,6}(?:\.\d{1,3})?) ?([KMGT])i?B?", str(text), re.IGNORECASE)
    return int(float(found[1]) * 1000 ** ("KMGT".index(found[2].upper()) + 1)) if found else None


def executor_of(settings: ExecutorSettings) -> Executor:
    """The executor that settings describe. Raises `BadInput` where it cannot be had."""
    target = _factories()[settings.name]
    module, _, name = target.partition(":")
    try:
        factory: Factory = getattr(import_module(module), name)
    except ImportError as error:
        raise BadInput(f"executor={settings.name}: {error}; {_to_install(settings.name)}") from None
    executor = factory(settings)
    if not hasattr(executor, "submit"):
        raise BadInput(f"executor={settings.name}: {target} gives a {type(executor).__name__}, expected an Executor")
    return executor


def _to_install(name: str) -> str:
    return f"pip install 'omninav[{name}]'" if name in BUILT_IN else f"install what the executor '{name}' needs"


def _factories() -> dict[str, str]:
    return {**{each.name: each.value for each in entry_points(group=ENTRY_POINTS)}, **BUILT_IN}


def own_options(settings: ExecutorSettings, known: tuple[str, ...]) -> dict[str, str]:
    """The options of an executor alone, as texts. Raises `ProblemsFound` for those that are not `known` or no words."""
    problems = []
    given = {name: str(value) for name, value in settings.options.items() if value is not None}
    for name, value in given.items():
        if name not in known:
            hint = suggest(name, ("workers", "memory", *known), "settings")
            problems.append(Problem(f"executor.{name}", f"the executor '{settings.name}' has no such setting", hint))
        elif not WORD.fullmatch(value):
            problems.append(Problem(f"executor.{name}", f"{value!r:.40}, expected a word without spaces"))
    if problems:
        raise ProblemsFound(problems)
    return given


def cores() -> int:
    """Number of processors that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def local(settings: ExecutorSettings) -> Executor:
    """Threads of this process, each of which waits for the process of one job."""
    own_options(settings, ())
    return ThreadPoolExecutor(settings.workers or cores(), "job")

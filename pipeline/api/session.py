"""Sessions: a graph that is pushed one frame at a time, by the engine that runs logs."""

import os
import threading
import warnings
from collections.abc import Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, ExitStack, chdir, contextmanager, suppress
from pathlib import Path
from types import TracebackType
from typing import Any

from omninav.pipeline.cli.jobs import no_run_in
from omninav.pipeline.engine.engine import Engine
from omninav.pipeline.graph.graph import Graph
from omninav.pipeline.graph.problems import BadInput, ProblemsFound, suggest
from omninav.pipeline.graph.pushed import Pushed, push
from omninav.pipeline.graph.registry import only_listed
from omninav.pipeline.run.execution import execute, running
from omninav.pipeline.run.prepared_run import PreparedRun
from omninav.pipeline.run.resume import reopened
from omninav.pipeline.run.run_folder import STEPS, RunFolder, start

from .arguments import arguments_of
from .configuration import Configuration, configured
from .plain_errors import plain_errors
from .read_only import read_only
from .run import Run

PUSHED = "source=pushed"
NOT_PUSHED = {
    "log": "a session has the frames that step() is given; omninav.run reads a log",
    "objective": "a session has all metrics in close().metrics; omninav.run and sweeps return one",
}
"""Settings that mean nothing to a session, and what to use."""


class Step(Mapping[str, Any]):
    """Outputs of the stages for a frame; None where one gave nothing.

    `out["match.similarities"]` is the output of a node, and `out.estimate` the one of that name, whichever node has it.
    Arrays are read-only, since the session keeps using them: `np.array(…)` copies one.
    """

    def __init__(self, values: Mapping[str, Any], names: Mapping[str, str]) -> None:
        self._values, self._names = {origin: values.get(origin) for origin in names.values()}, names
        self._given: dict[str, Any] = {}

    def __getitem__(self, name: str) -> Any:
        if name not in self._names:
            raise KeyError(f"there is no output '{name}'; {suggest(name, self._names, 'outputs')}")
        return self._output(self._names[name])

    def __getattr__(self, name: str) -> Any:
        names = self.__dict__.get("_names", {})
        if name not in names:
            short = [known for known in names if "." not in known]
            raise AttributeError(f"there is no output '{name}'; {suggest(name, short, 'outputs')}")
        return self._output(names[name])

    def _output(self, origin: str) -> Any:
        if origin not in self._given:
            self._given[origin] = read_only(self._values[origin])
        return self._given[origin]

    def __repr__(self) -> str:
        return f"Step({', '.join(sorted(name for name in self._names if '.' not in name))})"

    def __iter__(self) -> Iterator[str]:
        return iter(self._names)

    def __len__(self) -> int:
        return len(self._names)

    def __dir__(self) -> list[str]:
        return [*super().__dir__(), *(name for name in self._names if "." not in name)]


class Session(AbstractContextManager["Session"]):
    """A run whose frames come one at a time. It is a run like any other: folder, checkpoints, metrics and report.

    `with` closes it at the end of its block; without `with`, call `close`. Where its block raises, `resume` continues
    with the next frame; where a stage failed or the process died, from the last `save`, or from the last of the
    checkpoints that are written every few seconds. It belongs to the process that opened it, and is used by one thread
    at a time.
    """

    def __init__(self, run: RunFolder, prepared: PreparedRun) -> None:
        source = prepared.graph.source
        if source is None or not isinstance(source.stage, Pushed):
            raise BadInput(f"{prepared.variant}: nothing can be pushed into its source; type {PUSHED}")
        self._source, self._run, self._names = source.stage, run, outputs_by_name(prepared.graph)
        self._stack = ExitStack()
        self._engine: Engine = self._stack.enter_context(running(run, prepared))
        self._given = self._engine.calls[source.name].times
        self._over: str | None = None
        self._process, self._used = os.getpid(), threading.Lock()
        self._user: int | None = None
        self._warned: set[str] = set()

    @property
    def folder(self) -> Path:
        """Folder of its files."""
        return self._run.folder

    @property
    def steps(self) -> int:
        """Number of frames that it has had."""
        return self._engine.ticks

    def step(self, **frame: Any) -> Step:
        """Push a frame and run every stage once. Its source states what a frame may bring (`omninav stages source`).

        Raises `BadInput` where the source refuses the frame, which is then discarded. Raises `StageFailed`
        where a stage raised; after that the session can only be resumed.
        """
        with self._alone():
            self._refuse_over()
            push(self._source, frame)
            given = len(self._given)
            try:
                self._engine.tick()
            except BaseException as error:
                # Some stages have run and others not, unless the source has refused the frame.
                if len(self._given) > given or not isinstance(error, BadInput):
                    self._over = "a stage failed; omninav.resume continues from the last checkpoint"
                raise
            self._say_warnings()
            return Step(self._engine.values, self._names)

    @contextmanager
    def _alone(self, wait: bool = False) -> Iterator[None]:
        """Keep other threads out for as long as the block runs; another one waits, or is refused.

        Raises `BadInput` then, and for a process that was forked from the session's.
        """
        if os.getpid() != self._process:
            raise BadInput(f"{self.folder}: process {self._process} has this session; open another one in this process")
        if not self._used.acquire(blocking=wait and self._user != threading.get_ident()):
            raise BadInput(f"{self.folder}: the session is in the middle of a step; use it from one thread at a time")
        self._user = threading.get_ident()
        try:
            yield
        finally:
            self._user = None
            self._used.release()

    def _refuse_over(self) -> None:
        if self._over is not None:
            raise BadInput(f"{self.folder}: {self._over}")

    def _say_warnings(self) -> None:
        """Say each warning of a stage when it is first given: its caller waits for no report."""
        for call in self._engine.calls.values():
            for sentence in call.ctx.warnings:
                if sentence not in self._warned:
                    self._warned.add(sentence)
                    warnings.warn(f"{self.folder.name}: {sentence}", stacklevel=3)

    def save(self) -> Path:
        """Write a checkpoint, from which `resume` continues; gives the run's folder."""
        with self._alone():
            self._refuse_over()
            self._engine.save()
        return self.folder

    def close(self) -> Run:
        """End it: what comes after the last frame runs (metrics, plots, report). Gives the finished run."""
        self.__exit__(None, None, None)
        return Run(self.folder)

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if os.getpid() != self._process and error is not None:
            return  # a process that was forked ends, and the session is not its own
        with self._alone(wait=True):
            if error is None and self._over is not None:
                error = BadInput(self._over)
            if error is not None:
                self._run.manifest[STEPS] = self.steps
                if self._over is None:
                    with suppress(Exception):  # what has ended the block is raised; resume reports what is missing
                        self._engine.save()
            self._over = "the session is closed; omninav.resume continues one that was interrupted"
            self._stack.__exit__(type(error) if error is not None else None, error, trace)
            self._stack = ExitStack()


def outputs_by_name(graph: Graph) -> dict[str, str]:
    """The output that each name denotes, and every output under its own (`node.port`).

    Of several of one name it is the one that is read again at the next tick, else the last in running order.
    """
    origins = [origin for node in graph.of_lifetime("tick") for origin in node.origins]
    again = {wire.origin for wire in graph.wires if wire.delay}
    names = {origin.partition(".")[2]: origin for origin in sorted(origins, key=lambda origin: origin in again)}
    return names | {origin: origin for origin in origins}


@plain_errors()
def open(*words: str | Configuration, folder: str | os.PathLike[str] | None = None, **settings: Any) -> Session:
    """Begin a session: `with omninav.open("some_variant") as session: out = session.step(…)`.

    Words and settings are those of `compose`, or a configuration comes first. `folder`: where the run's files are left;
    None: a new one in `runs`. Raises `BadInput` where the variant is no session, or a setting is not one of sessions.
    """
    given = [each for word in words for each in (word.words if isinstance(word, Configuration) else (word,))]
    typed = arguments_of(tuple(given), settings)
    pushed = PUSHED in typed or "source" in settings
    names = {word.partition("=")[0] for word in typed}
    for name, instead in NOT_PUSHED.items():
        if name in names:
            raise BadInput(f"{name}=…: {instead}")
    try:
        made = configured(words if pushed else (*words, PUSHED), settings)
    except ProblemsFound as found:
        if pushed or not all(problem.where.startswith("wires.") for problem in found.problems):
            raise
        why = f"{found.problems[0].where}: {found.problems[0].what}"
        raise BadInput(f"{' '.join(typed):.80}: nothing can be pushed into it ({why}); use omninav.run") from None
    place = None if folder is None else no_run_in(Path(folder), "folder")
    return Session(start(made.prepared, ["omninav", *made.words], place), made.prepared)


@plain_errors()
def resume(folder: str | os.PathLike[str] = "runs/latest", trust: Sequence[str] = ()) -> Run | Session:
    """Go on with what was interrupted: a session with its next frame, any other run to its end.

    The bytes are those that it would have given unbroken. Of the stages that the folder names, those that `omninav
    stages` lists are run, and others only where their module or file is in `trust`, programs (`command=`) only where
    they are. Raises `BadInput`.
    """
    given = Path(os.path.realpath(folder))
    run = RunFolder(given)
    with chdir("."), only_listed(trust):  # a run continues where it was started, and the program here
        prepared = reopened(run, given)
        if prepared is None:
            return Run(given)
        if prepared.graph.source is not None and isinstance(prepared.graph.source.stage, Pushed):
            return Session(run, prepared)
        execute(run, prepared)
        return Run(given)

"""Running what was prepared, in its folder, to the files that are left at the end."""

import json
import logging
import os
import shlex
import shutil
import traceback
from collections.abc import Iterator
from contextlib import chdir, contextmanager, suppress
from datetime import datetime
from io import TextIOWrapper
from pathlib import Path
from typing import Any

from omninav.pipeline.engine.artifact import artifact_digest, write_artifact
from omninav.pipeline.engine.cache import Cache
from omninav.pipeline.engine.call import StageFailed
from omninav.pipeline.engine.damage import report_damage
from omninav.pipeline.engine.engine import Engine, EngineOptions
from omninav.pipeline.engine.prefix import cached_prefix, keep_prefix
from omninav.pipeline.files import DISK, digest_file, open_itself, whole_file, write_whole
from omninav.pipeline.graph.problems import BadInput, counted
from omninav.pipeline.graph.results import Metrics
from omninav.pipeline.graph.value import Value
from omninav.pipeline.report.run_page import write_report

from .artifacts import Execution, ProgressDisplay, companions, identity, obtain, provenance
from .costly_values import costly_values
from .metrics_files import MANIFEST, read_metrics, write_metrics
from .prepared_run import PreparedRun, same_inputs
from .run_folder import CONFIG, STEPS, Interrupted, RunFolder, recorded_name
from .run_results import notes_of, results_of
from .timing import stage_times

log = logging.getLogger("omninav")
LOG = "run.log"


def execute(run: RunFolder, prepared: PreparedRun, display: ProgressDisplay | None = None) -> Metrics:
    """Run a prepared configuration in its folder, from its start or from where it was left, and return its metrics.

    Raises `StageFailed` or `BadInput`; by then the manifest records it and the traceback is in `run.log`.
    """
    with chdir("."), running(run, prepared, display) as engine:  # a stage may change the folder for itself alone
        while engine.tick():
            pass
    return read_metrics(run.folder)


@contextmanager
def running(run: RunFolder, prepared: PreparedRun, display: ProgressDisplay | None = None) -> Iterator[Engine]:
    """The engine of a prepared configuration, ready for its next tick; its owner calls `tick`.

    When the block ends well, what comes after the loop has run and the folder is complete. When it raises, the manifest
    records it, and the run can continue from its last checkpoint.
    """
    with run.owned(), _logged(run):
        try:
            yield from _running(run, prepared, display)
        except KeyboardInterrupt:
            if run.manifest["status"] != "complete":
                _fail(run, "interrupted", "stopped by the user")
                raise Interrupted(run.folder) from None
            run.save()
        except (StageFailed, BadInput) as error:
            _fail(run, "failed", str(error))
            raise
        except Exception as error:
            if isinstance(error, OSError) and error.errno in DISK:
                error.filename = error.filename or str(run.folder)  # writing to an open file names none
                error.add_note(f"`omninav resume {shlex.quote(str(run.folder))}` continues the run")
            _fail(run, "failed", f"{type(error).__name__}: {error}")
            raise


def _running(run: RunFolder, prepared: PreparedRun, display: ProgressDisplay | None) -> Iterator[Engine]:
    config = prepared.config
    Engine(prepared.graph, {}, EngineOptions(prepared.seed)).check_source()  # before time is spent on artifacts
    cache = Cache(Path(str(config["cache"])).absolute()) if config.get("cache") else None
    execution = Execution(
        run, prepared.seed, cache, float(config.get("checkpoint_s", 5.0)), display, bool(config.get("validate", False))
    )
    artifacts: dict[str, Value] = {}
    made: dict[str, Any] = {}
    for artifact in prepared.artifacts:
        together = companions(artifact, prepared.artifacts)
        artifacts[artifact.name], made[artifact.name] = obtain(execution, artifact, together)
    run.manifest["artifacts"] = made
    run.save()
    own = identity(prepared.graph, prepared.seed, *(facts["sha256"] for facts in made.values()))
    options = execution.options(prepared.variant, run.memory, own, run.folder)
    wanted = sorted(set(prepared.saves.values()))
    with cached_prefix(prepared.graph, cache, prepared.seed, {*wanted, *prepared.record}) as prefix:
        graph, recorded = prepared.graph, prefix.recorded()
        engine = Engine(
            graph, artifacts, options, wanted=wanted, replay=prefix.replay, recorded=recorded, kept=prepared.record
        )
        try:
            with costly_values(engine, cache, {name: facts["sha256"] for name, facts in made.items()}, prepared.seed):
                engine.begin()
            _say_what_is_missing(run, engine.ticks)
            yield engine
            last = engine.finish()
        except BaseException:
            engine.close()  # what continues the run, perhaps in this process, writes to the same files
            raise
        keep_prefix(engine, prefix, cache)
    for name, origin in prepared.saves.items():
        value = last[origin]
        if isinstance(value, Value):
            file = run.folder / f"{name}.omap"
            write_artifact(file, value, provenance(prepared.graph.leading_to([origin]), engine, prepared.variant))
            saved = {"file": file.name, "bytes": file.stat().st_size, "sha256": artifact_digest(file)}
            run.manifest.setdefault("saved", {})[name] = saved
    for origin in prepared.record:
        with whole_file(run.folder / recorded_name(origin)) as part:
            engine.sequences[origin].flush()
            shutil.copyfile(engine.sequences[origin].path, part)
    _finish(run, engine, prefix.reason, _doubts(prepared, run.manifest["inputs"], engine.ticks))


def _say_what_is_missing(run: RunFolder, ticks: int) -> None:
    """Report how many frames of an interrupted session came after the checkpoint that it continues from."""
    steps = run.manifest.pop(STEPS, 0)
    if steps > ticks:
        what = f"{steps - ticks:,} of {counted(steps, 'frame')}"
        report_damage(f"{run.folder}: the last {what} were not kept; omninav.resume takes them again")


def _doubts(prepared: PreparedRun, inputs: dict[str, str], ticks: int) -> list[str]:
    """Warnings on the run as a whole."""
    source = prepared.graph.source
    nothing = [f"{source.name} gave no tick, so nothing has run in the loop"] if source and not ticks else []
    return nothing + same_inputs(prepared, inputs)


def _finish(run: RunFolder, engine: Engine, prefix_reason: str, doubts: list[str]) -> None:
    metrics, plots, tables = results_of(engine)
    notes, timing = notes_of(engine), stage_times(engine)
    write_metrics(run.folder, metrics)
    write_whole(run.folder / "timing.json", json.dumps(timing, indent=1) + "\n")
    artifacts = _with_own_notes(run.manifest["artifacts"])
    facts = {
        f"{key} ({name})": value
        for name, artifact in artifacts.items()
        for key, value in (artifact.get("facts") or {}).items()
    }
    warnings = [
        f"{name}: {sentence!s:.300}"
        for name, artifact in artifacts.items()
        if isinstance(artifact.get("warnings"), list)  # of a file, which may hold anything
        for sentence in artifact["warnings"]
    ]
    dropped = _dropped_before(artifacts) | notes["dropped"]
    run.manifest |= {
        "ended": datetime.now().isoformat(timespec="seconds"),
        "ticks": engine.ticks,
        "dropped": dropped,
        "facts": facts | notes["facts"],
        "warnings": doubts + warnings + notes["warnings"],
        "prefix": prefix_reason,
    }
    for kind, entry in dropped.items():
        log.warning("%s: %s%s", kind, entry["count"], f" (first: {entry['first']})" if entry["first"] else "")
    graph_svg, config_yaml = ((run.folder / name).read_text(encoding="utf-8") for name in ("graph.svg", CONFIG))
    done = {**run.manifest, "status": "complete"}
    write_report(run.folder, done, metrics, timing, graph_svg, plots, tables, config_yaml, engine.graph, run.shown_as)
    run.manifest = done | {"files": _digests(run.folder)}
    run.save()
    engine.close()
    shutil.rmtree(run.memory, ignore_errors=True)


def _with_own_notes(artifacts: dict[str, Any]) -> dict[str, Any]:
    """The artifacts that state something new: what came together from one graph states the same."""
    found: dict[str, Any] = {}
    for name, artifact in artifacts.items():
        notes = [artifact.get(key) for key in ("variant", "facts", "warnings")]
        if notes not in ([other.get(key) for key in ("variant", "facts", "warnings")] for other in found.values()):
            found[name] = artifact
    return found


def _dropped_before(artifacts: dict[str, Any]) -> dict[str, Any]:
    """Counts of what was dropped as artifacts were made, each under the first that has it; without those of files,
    which were reported as those were made."""
    found: dict[str, Any] = {}
    for name, artifact in artifacts.items():
        for kind, entry in ({} if "file" in artifact else artifact.get("dropped") or {}).items():
            if not any(key.startswith(f"{kind} (") and entry == other for key, other in found.items()):
                found[f"{kind} ({name})"] = entry
    return found


def _digests(folder: Path) -> dict[str, str]:
    """The content hashes of a complete run's files, so that damage to them is found."""
    files = (path for path in sorted(folder.iterdir()) if path.is_file() and not path.is_symlink())
    return {path.name: digest_file(path) for path in files if path.name not in (MANIFEST, LOG, ".lock")}


def _fail(run: RunFolder, status: str, what: str) -> None:
    run.manifest |= {"status": status, "error": what, "ended": datetime.now().isoformat(timespec="seconds")}
    with suppress(OSError):  # a full disk; what stopped the run is raised, and the run can continue without this
        run.save()
    log.error("%s\n%s", what, traceback.format_exc())


class _LogFile(logging.FileHandler):
    """Appends to a file, never through a link; a full disk stops the run and not its log."""

    def _open(self) -> TextIOWrapper:
        return os.fdopen(
            open_itself(Path(self.baseFilename), os.O_WRONLY | os.O_CREAT | os.O_APPEND), "a", encoding="utf-8"
        )

    def handleError(self, record: logging.LogRecord) -> None:  # noqa: N802
        """Say nothing: what cannot be written here is reported elsewhere."""


@contextmanager
def _logged(run: RunFolder) -> Iterator[None]:
    handler = _LogFile(run.folder / LOG, encoding="utf-8")
    handler.setFormatter(logging.Formatter("%(asctime)s %(levelname)s %(message)s"))
    log.addHandler(handler)
    log.setLevel(logging.INFO)
    log.propagate = False
    log.disabled = False  # Hydra's logging set-up silences loggers that were there before it
    try:
        log.info("omninav %s", " ".join(run.manifest["argv"][1:]) or "(the embedded default)")
        yield
        log.info("complete: %s ticks", run.manifest.get("ticks"))
    finally:
        log.removeHandler(handler)
        handler.close()

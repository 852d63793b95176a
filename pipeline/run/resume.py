"""Going on with a run that was stopped."""

import os
import shlex
import shutil
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from omninav.pipeline.engine.codec import BadEncoding, decode, unseal
from omninav.pipeline.engine.damage import report_damage
from omninav.pipeline.files import Damaged, digest_file, digest_text, read_json
from omninav.pipeline.graph.ports import convert_fields
from omninav.pipeline.graph.problems import BadInput, ProblemsFound
from omninav.pipeline.graph.registry import is_listed, module_of
from omninav.pipeline.graph.results import Metrics
from omninav.pipeline.graph.small_files import parse_yaml, read_mapping

from .artifacts import ProgressDisplay
from .execution import execute
from .metrics_files import MANIFEST, read_metrics
from .prepared_run import PreparedRun, input_digests, prepare_run
from .run_folder import CONFIG, STEPS, RunFolder


@dataclass(frozen=True)
class Manifest:
    """State from which a run continues."""

    status: str
    argv: tuple[str, ...]
    cwd: str
    config: str
    """`digest_text` of config.yaml."""
    inputs: dict[str, str]
    """Hashes of what the run reads, by node or artifact."""
    files: dict[str, str]
    """Hashes of a complete run's files."""
    steps: int
    """Number of frames that a session had when it was interrupted; 0: not stated."""


def resume(folder: Path, display: ProgressDisplay | None = None) -> tuple[RunFolder, Metrics]:
    """Go on with a run that was stopped, from its last checkpoint, to the bytes it would have given unbroken.

    What is damaged in its folder is made again, from the start where need be. Raises `BadInput` where another process
    runs it, and where too much is damaged to know what the run was.
    """
    run = RunFolder(Path(os.path.realpath(folder)))
    with run.owned():
        prepared = reopened(run, folder)
        return run, read_metrics(folder) if prepared is None else execute(run, prepared, display)


def command_to_resume(folder: Path, shown: str = "") -> str:
    """The command that continues a run of one's own (`shown`: its folder), with the code that it asks to be typed."""
    targets: list[str] = []
    _find_targets(read_mapping(folder / CONFIG) if (folder / CONFIG).is_file() else {}, targets)
    of_others = dict.fromkeys(module_of(target) for target in targets if not is_listed(target))
    return shlex.join(["omninav", "resume", shown or str(folder), *of_others])


def _find_targets(content: Any, found: list[str]) -> None:
    for name, value in content.items() if isinstance(content, dict) else enumerate(content):
        if name == "_target_":
            found.append(str(value))
        elif isinstance(value, dict | list):
            _find_targets(value, found)


def no_run(folder: Path) -> BadInput:
    """The error for a folder in which no run has begun."""
    if any(folder.glob(f"*/{MANIFEST}")):
        return BadInput(
            f"{folder}: a folder of runs; give one of them, and continue a sweep by its own command: omninav -m … "
            f"hydra.sweep.dir={shlex.quote(str(folder))}"
        )
    return BadInput(f"{folder}: not a run folder (no manifest.json and config.yaml); `ls runs` shows what there is")


def reopened(run: RunFolder, folder: Path) -> PreparedRun | None:
    """Prepares a stopped run to be executed in its folder, from the directory in which it was started.

    None where it is complete. Raises `BadInput` as `resume` does.
    """
    if not (folder / MANIFEST).is_file() and not run.beginning.is_file():
        raise no_run(folder)
    with run.owned():
        return _reopened(run, folder)


def _reopened(run: RunFolder, folder: Path) -> PreparedRun | None:
    for half_written in folder.glob("*.part"):  # by the process that was killed; it is written again
        half_written.unlink()
    began, config = _beginning(run, folder)
    if began.status == "complete":
        damaged = next((name for name, digest in began.files.items() if not _is_whole(run.folder / name, digest)), None)
        if damaged is None:
            shutil.rmtree(run.memory, ignore_errors=True)
            run.complete = True
            return None
        report_damage(f"{folder}: {damaged} is damaged or gone; the run is made again")
    if Path(began.cwd).is_dir():
        os.chdir(began.cwd)  # its paths are relative to where it was started
    again = shlex.join(began.argv)
    try:
        prepared = prepare_run(parse_yaml(config, str(folder / CONFIG)))
    except ProblemsFound as found:
        if all(problem.where.startswith(("nodes.", "wires.", "artifacts.")) for problem in found.problems):
            message = f"{folder}: made with an older omninav, whose stages are no longer known; start it again: {again}"
            raise BadInput(message) from None
        raise
    inputs = input_digests(prepared)
    changed = [name for name, digest in inputs.items() if began.inputs.get(name) != digest]
    if changed:
        raise BadInput(f"{folder}: {', '.join(changed)} changed since the run was started; start a new run")
    run.describe(prepared, config)
    run.manifest["status"] = "running"
    for name in ("error", "ended", "files", "saved", "artifacts"):
        run.manifest.pop(name, None)
    run.seal_beginning(config)
    run.save()
    return prepared


def complete_run(folder: Path) -> tuple[RunFolder, str]:
    """A run that has ended, and the text of its configuration. Raises `BadInput` where it is not a complete one."""
    run = RunFolder(Path(os.path.realpath(folder)))
    if not (folder / MANIFEST).is_file():
        raise no_run(folder)
    began, config = _beginning(run, folder)
    if began.status != "complete":
        raise BadInput(
            f"{folder}: the run is {began.status:.40}; `omninav resume {shlex.quote(str(folder))}` continues it"
        )
    return run, config


def _beginning(run: RunFolder, folder: Path) -> tuple[Manifest, str]:
    """The manifest and the text of the configuration, or what was sealed of them where they are damaged."""
    sealed: Mapping[str, Any] = {}
    try:
        if run.beginning.is_file():
            sealed = decode(unseal(run.beginning.read_bytes(), str(run.beginning)))
    except BadEncoding:
        pass  # it is only there for when something else is damaged
    try:
        run.manifest = read_json(run.folder / MANIFEST)
    except Damaged as damaged:
        if not sealed:
            raise BadInput(f"{damaged}; what the run was is no longer known: start it again") from None
        report_damage(f"{damaged}; it is written again")
        run.manifest = dict(sealed["manifest"])
    known = {name: run.manifest[name] for name in Manifest.__dataclass_fields__ if name in run.manifest}
    arguments, problems = convert_fields({"files": {}, STEPS: 0} | known, Manifest, MANIFEST)
    if problems:
        raise BadInput(f"{folder}: {problems[0].where}: {problems[0].what}; start the run again")
    began = Manifest(**arguments)
    file = run.folder / CONFIG
    text = file.read_bytes().decode("utf-8", "replace") if file.is_file() else ""
    if digest_text(text) != began.config:
        text = str(sealed.get("config", ""))
        if digest_text(text) != began.config:
            again = shlex.join(began.argv)
            raise BadInput(
                f"{folder}: config.yaml is damaged, or was changed by hand; delete this folder and start again: {again}"
            )
        report_damage(f"{folder}: config.yaml is damaged, or was changed by hand; it is written again as it was")
    return began, text


def _is_whole(file: Path, digest: str) -> bool:
    return file.is_file() and digest_file(file) == digest

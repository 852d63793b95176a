"""Going on with a run that was stopped."""

import json
import os
import shlex
import shutil
from pathlib import Path

import yaml

from omninav.pipeline.graph.problems import BadInput, ProblemsFound
from omninav.pipeline.graph.results import Metrics

from .artifacts import ProgressDisplay
from .execution import execute
from .metrics_files import read_metrics
from .plan import input_digests, plan
from .run_folder import Run


def resume(folder: Path, display: ProgressDisplay | None = None) -> tuple[Run, Metrics]:
    """Go on with a run that was stopped, from its last checkpoint, to the bytes it would have given unbroken."""
    manifest_file, config_file = folder / "manifest.json", folder / "config.yaml"
    if not manifest_file.is_file() or not config_file.is_file():
        raise BadInput(f"{folder}: not a run folder (no manifest.json and config.yaml); `ls runs` shows what there is")
    run = Run(folder.resolve(), json.loads(manifest_file.read_text()))
    for half_written in folder.glob("*.part"):  # by the process that was killed; it is written anew
        half_written.unlink()
    if run.manifest["status"] == "complete":
        shutil.rmtree(run.memory, ignore_errors=True)
        return run, read_metrics(folder)
    if Path(run.manifest["cwd"]).is_dir():
        os.chdir(run.manifest["cwd"])  # its paths are relative to where it was started
    try:
        planned = plan(yaml.safe_load(config_file.read_text()))
    except ProblemsFound as found:
        if all(problem.where.startswith(("nodes.", "wires.", "artifacts.")) for problem in found.problems):
            again = shlex.join(run.manifest["argv"])
            message = f"{folder}: made with an older omninav, whose stages are no longer known; start it again: {again}"
            raise BadInput(message) from None
        raise
    inputs = input_digests(planned)
    changed = [name for name, digest in inputs.items() if run.manifest["inputs"].get(name) != digest]
    if changed:
        raise BadInput(f"{folder}: {', '.join(changed)} changed since the run was started; start a new run")
    run.manifest["status"] = "running"
    run.manifest.pop("error", None)
    run.save()
    return run, execute(run, planned, display)

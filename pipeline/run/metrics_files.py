"""A run's metrics as files: `metrics.json` holds the values, `quantities.json` how they are read."""

import dataclasses
import json
import shlex
from contextlib import suppress
from pathlib import Path
from typing import Any

from omninav.pipeline.files import Damaged, digest_file, read_json, write_whole
from omninav.pipeline.graph.problems import BadInput
from omninav.pipeline.graph.results import Metrics, MetricSpec

MANIFEST = "manifest.json"


def write_metrics(folder: Path, metrics: Metrics) -> None:
    """Write both files into a run's folder."""
    described = {
        "quantities": {path: dataclasses.asdict(spec) for path, spec in metrics.specs.items()},
        "headlines": metrics.headlines,
        "details": metrics.details,
    }
    write_whole(folder / "metrics.json", json.dumps(metrics.values, indent=1, sort_keys=True) + "\n")
    write_whole(folder / "quantities.json", json.dumps(described, indent=1, ensure_ascii=False) + "\n")


def read_metrics(folder: Path) -> Metrics:
    """The metrics of a run that ended; those of an older run, without `quantities.json`, are not described.

    Raises `BadInput` where there are none, or not those that the run wrote.
    """
    file, description = folder / "metrics.json", folder / "quantities.json"
    if not folder.is_dir():
        raise BadInput(f"{folder}: there is no such folder; `ls runs` shows what there is")
    if not file.is_file():
        refuse_experiment(folder)
        raise BadInput(f"{folder}: no metrics.json in it; is it a run that ended?")
    values = _read(file)
    if not description.is_file():
        return Metrics(values)
    described = _read(description)
    try:
        specs = {path: MetricSpec(**plain) for path, plain in described["quantities"].items()}
        return Metrics(values, specs, tuple(described["headlines"]), tuple(described["details"]))
    except (LookupError, TypeError, AttributeError, ValueError):
        raise _damaged(description) from None


def refuse_experiment(folder: Path) -> None:
    """Raise `BadInput` for the folder of an experiment, which is no run, with its page."""
    if (folder / "experiment.json").is_file():
        page = next(iter(sorted(folder.glob("*.html"))), None)
        seen = f"open {page}" if page else f"`omninav resume {shlex.quote(str(folder))}` continues it"
        raise BadInput(f"{folder}: an experiment, not a run; {seen}")


def read_timing(folder: Path) -> dict[str, Any]:
    """Durations of a run's stages; nothing where they are not known."""
    file = folder / "timing.json"
    return _read(file) if file.is_file() else {}


def _read(file: Path) -> dict[str, Any]:
    with suppress(Damaged):
        files = read_json(file.parent / MANIFEST).get("files")
        if isinstance(files, dict) and files.get(file.name, digest_file(file)) != digest_file(file):
            raise _damaged(file)
    try:
        return dict(json.loads(file.read_bytes()))
    except (ValueError, TypeError, RecursionError):
        raise _damaged(file) from None


def _damaged(file: Path) -> BadInput:
    return BadInput(
        f"{file} is damaged or was changed; `omninav resume {shlex.quote(str(file.parent))}` makes the run again"
    )

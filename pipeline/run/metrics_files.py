"""A run's metrics as files: `metrics.json` holds the values, `quantities.json` how they are read."""

import dataclasses
import json
from pathlib import Path

from omninav.pipeline.files import write_whole
from omninav.pipeline.graph.problems import BadInput
from omninav.pipeline.graph.results import Metrics, Quantity


def write_metrics(folder: Path, metrics: Metrics) -> None:
    """Write both files into a run's folder."""
    described = {
        "quantities": {path: dataclasses.asdict(quantity) for path, quantity in metrics.quantities.items()},
        "headlines": metrics.headlines,
        "details": metrics.details,
    }
    write_whole(folder / "metrics.json", json.dumps(metrics.values, indent=1, sort_keys=True) + "\n")
    write_whole(folder / "quantities.json", json.dumps(described, indent=1, ensure_ascii=False) + "\n")


def read_metrics(folder: Path) -> Metrics:
    """The metrics of a run that ended; those of an older run, without `quantities.json`, are not described."""
    file, description = folder / "metrics.json", folder / "quantities.json"
    if not file.is_file():
        raise BadInput(f"{folder}: no metrics.json in it; is it a run that ended?")
    values = json.loads(file.read_text())
    if not description.is_file():
        return Metrics(values)
    described = json.loads(description.read_text())
    quantities = {path: Quantity(**plain) for path, plain in described["quantities"].items()}
    return Metrics(values, quantities, tuple(described["headlines"]), tuple(described["details"]))

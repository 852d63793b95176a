"""A run's metrics as a stage states them, for the tests of pages and tables."""

from pathlib import Path
from typing import Any

from omninav.pipeline import Metrics, MetricSpec

ERRORS = {"mean": 0.5, "median": 0.073, "p90": 0.81, "max": 12.34}
VALUES = {
    "frames": 300,
    "position_error_m": ERRORS,
    "loss_rate": 0.125,
    "converged_after_frames": 12,
    "after_convergence": {"position_error_m": {**ERRORS, "median": 0.05}, "loss_rate": 0.0},
    "odometry_alone": {"position_error_m": {**ERRORS, "median": 1.7}, "loss_rate": 0.5},
    "map": {"size_bytes": 168_000, "references": 200},
}
SPECS = {
    "position_error_m": MetricSpec(better="lower"),
    "loss_rate": MetricSpec(better="lower"),
    "converged_after_frames": MetricSpec(title="Converged", before="after", better="lower", absent="never"),
    "frames": MetricSpec(),
}
HEADLINES = ("after_convergence.position_error_m.median", "loss_rate", "converged_after_frames")


def measured(**changes):
    """The sample metrics with some values changed."""
    return Metrics({**VALUES, **changes}, SPECS, HEADLINES, ("odometry_alone",))


def sweep_row(job: int, metrics: Metrics | None, folder: Path = Path(), **manifest: Any) -> dict[str, Any]:
    """Makes the row of one job in a sweep's tables; one that failed has no metrics."""
    return {"job": str(job), "folder": folder, "manifest": {"status": "complete", **manifest}, "metrics": metrics}


def compared(name: str, metrics: Metrics, **config: object) -> dict[str, Any]:
    """Makes one run of a comparison."""
    return {"name": name, "metrics": metrics, "config": config, "manifest": {}}

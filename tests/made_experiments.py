"""Experiments of one measure, `error`, for tests, and what a run gives them."""

from typing import Any

from omninav.pipeline.experiment.specification import Experiment, read_experiment

FILE: dict[str, Any] = {
    "name": "test",
    "title": "A test",
    "about": "",
    "variant": "none",
    "measures": {"error": {"title": "Error", "path": ["error"]}},
    "page": {"rows": [], "columns": "method"},
}


def experiment(**entries: object) -> Experiment:
    """The experiment of a file with these entries, its sweep among them."""
    return read_experiment(FILE | entries, "full")


def run_with(**metrics: object) -> dict[str, Any]:
    """The result of a run with these metrics."""
    return {"metrics": metrics, "timing": {}, "facts": {}}

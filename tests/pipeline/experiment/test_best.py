"""The best of several conditions, by the rule of the procedure."""

import pytest
from made_experiments import experiment, run_with

from omninav.pipeline.experiment.best import best_condition
from omninav.pipeline.experiment.verdicts import key_of

SWEPT = experiment(
    sweep={"value": {"1": "x=1", "2": "x=2", "3": "x=3"}},
    measures={"lost": {"title": "Lost (%)", "path": ["lost"]}, "error": {"title": "Error (cm)", "path": ["error"]}},
    page={"rows": [], "columns": "value"},
    best=["lost", "error"],
)


def best(**figures: list[tuple[float, float | None]]) -> tuple[str, str] | None:
    """Label and words of the best, of runs with these loss rates and errors by label."""
    results = {
        key_of({"value": label[1:]}): {
            (f"draw {n}", n): run_with(lost=lost, error=error) for n, (lost, error) in enumerate(runs)
        }
        for label, runs in figures.items()
    }
    found = best_condition(SWEPT, results)
    return None if found is None else (found[0].labels["value"], found[1])


@pytest.mark.parametrize(
    ("figures", "found"),
    [
        ({"v1": [(0.0, 30.0)] * 2, "v2": [(1.0, 5.0)] * 2, "v3": [(0.5, 9.0)] * 2}, ("1", 0.0, 30.0)),
        ({"v1": [(0.0, 30.0)] * 2, "v2": [(0.0, 5.0), (0.0, 7.0)], "v3": [(1.0, 1.0)] * 2}, ("2", 0.0, 6.0)),
        ({"v1": [(0.0, None), (0.0, 1.0)], "v2": [(0.0, 50.0)] * 2}, ("2", 0.0, 50.0)),
        ({"v2": [(0.0, 5.0), (2.0, 7.0)]}, ("2", 1.0, 6.0)),
    ],
)
def test_the_best_is_lost_least_and_among_equals_errs_least_and_is_named_with_its_figures(figures: dict, found: tuple):
    label, lost, error = found
    assert best(**figures) == (label, f"Lost (%) {lost}, Error (cm) {error}")


def test_of_what_has_not_run_nothing_is_best():
    assert best() is None

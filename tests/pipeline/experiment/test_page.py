"""Figures on an experiment's page."""

from pathlib import Path

import pytest

from omninav.pipeline.experiment.conditions import ConditionRun
from omninav.pipeline.experiment.page import number
from omninav.pipeline.experiment.runner import reference_text
from omninav.pipeline.experiment.specification import Condition, read_experiment


@pytest.mark.parametrize(
    ("value", "text"),
    [(12.34, "12.3"), (0.0, "0.0"), (0.0227, "0.02"), (-0.004, "-0.004"), (None, "–"), (float("nan"), "–")],
)
def test_a_figure_has_its_digits_and_looks_like_nought_only_where_it_is(value: float | None, text: str) -> None:
    assert number(value, 1) == text


def test_a_sentence_about_reference_runs_has_the_mean_over_their_scenarios() -> None:
    file = {
        "name": "test",
        "title": "A test",
        "about": "",
        "variant": "none",
        "sweep": {"tour": {"one": "x=1"}},
        "measures": {"error": {"title": "Error", "path": ["error"]}},
        "page": {"rows": [], "columns": "tour"},
        "reference_runs": [{"text": "Without: {}.", "variant": "other", "measure": "error", "over": "tour"}],
    }
    of = Condition({"tour": "one"}, "x=1")
    runs = [
        ConditionRun(
            of,
            scenario,
            "other",
            (),
            Path(),
            (0,),
            results={0: {"metrics": {"error": e}, "timing": {}, "facts": {}}},
        )
        for scenario, e in (("draw 101", 1.0), ("draw 102", 2.0))
    ]
    experiment = read_experiment(file, "full")
    assert reference_text(experiment, experiment.reference_runs[0], runs) == "Without: one 1.5."

"""What an experiment's file describes."""

import pytest

from omninav.pipeline.experiment.specification import read_experiment
from omninav.pipeline.graph.problems import ProblemsFound

FILE = {
    "name": "test",
    "title": "A test",
    "about": "",
    "variant": "none",
    "sweep": {"method": {"a": "x=1", "b": "x=2"}, "data": {"first": "y=1", "second": "y=2"}},
    "measures": {"error": {"title": "Error", "path": ["error"]}},
    "page": {"rows": ["data"], "columns": "method"},
}


def test_conditions_are_all_combinations_but_those_left_out():
    file = FILE | {"without": [{"method": "b", "data": "first"}]}
    found = read_experiment(file, "paper").conditions()
    assert [condition.overrides for condition in found] == ["x=1 y=1", "x=1 y=2", "x=2 y=2"]


def test_a_profile_changes_mappings_key_by_key_and_null_takes_a_label_out():
    file = FILE | {"profiles": {"quick": {"sweep": {"data": {"first": "y=9", "second": None}}, "repetitions": 2}}}
    quick = read_experiment(file, "quick")
    assert [condition.overrides for condition in quick.conditions()] == ["x=1 y=9", "x=2 y=9"]
    assert quick.repetitions == 2


@pytest.mark.parametrize(
    ("change", "problem"),
    [
        ({"page": {"rows": [], "columns": "method"}}, "each factor of the sweep is a row or the column"),
        ({"repetitions": 0}, "expected at least 1"),
        ({"curves": [{"title": "t", "x_label": "x", "path": "p", "panels": "methods"}]}, "there is no 'methods'"),
        ({"measures": {"error": {"title": "Error", "of": ["error"]}}}, "Measure has no parameter 'of'"),
    ],
)
def test_a_file_that_contradicts_itself_is_refused(change: dict[str, object], problem: str):
    with pytest.raises(ProblemsFound, match=problem):
        read_experiment(FILE | change, "paper")

from pathlib import Path

from made_experiments import experiment, run_with

from omninav.pipeline.experiment.conditions import ConditionRun, results_by_condition
from omninav.pipeline.experiment.result import Cell, summary_of
from omninav.pipeline.experiment.specification import Condition
from omninav.pipeline.experiment.verdicts import key_of


def test_a_repetition_that_failed_counts_as_one_without_a_figure() -> None:
    condition = Condition({"method": "a"}, "")
    done = ConditionRun(condition, "world 1", (), Path("one"), (0, 1), results={0: {}, 1: {}})
    failed = ConditionRun(condition, "world 2", (), Path("two"), (0, 1), results={0: {}}, error="no such file")
    under_way = ConditionRun(condition, "world 3", (), Path("three"), (0, 1), results={0: {}})
    found = results_by_condition([done, failed, under_way])[key_of({"method": "a"})]
    assert list(found) == [("world 1", 0), ("world 1", 1), ("world 2", 0), ("world 2", 1), ("world 3", 0)]
    assert found["world 2", 1]["metrics"] == {}


def test_a_cell_has_mean_and_median_the_spread_of_several_runs_and_the_figure_of_development() -> None:
    one, several = key_of({"method": "a"}), key_of({"method": "b"})
    runs = {("w", n): run_with(**given) for n, given in enumerate(({"error": 3.0}, {"error": 5.0}, {}))}
    results = {one: {("w", 0): run_with(error=3.0)}, several: runs}
    compared = experiment(sweep={"method": {"a": "", "b": ""}})
    _, cells, _ = summary_of(compared, results, {several: {("d", 0): run_with(error=9.0)}})
    assert cells["error"] == (Cell(("a",), 3.0, None, 3.0, 1, 1), Cell(("b",), 4.0, 1.0, 4.0, 2, 3, 9.0))

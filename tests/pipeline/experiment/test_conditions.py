from pathlib import Path

from omninav.pipeline.experiment.conditions import ConditionRun, results_by_condition
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

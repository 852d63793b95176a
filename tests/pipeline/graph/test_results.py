import json
import math

import numpy as np

from omninav.pipeline import Metrics, MetricSpec
from omninav.pipeline.graph.results import by_path, merged


def test_metrics_of_several_stages_are_merged_group_by_group():
    one = Metrics({"group": {"a": 1, "b": 1}}, {"a": MetricSpec(title="A")}, ("group.a",), ("group",))
    two = Metrics({"group": {"b": 2}, "c": 3}, {"c": MetricSpec(title="C")}, ("c", "group.a"))
    both = merged([one, two])
    assert both.values == {"group": {"a": 1, "b": 2}, "c": 3}
    assert [spec.title for spec in both.specs.values()] == ["A", "C"]
    assert both.headlines == ("group.a", "c")
    assert both.details == ("group",)
    assert one.values == {"group": {"a": 1, "b": 1}}
    assert [*by_path({"a": {"b": 1, "c": {}}, "d": 2})] == [("a.b", 1), ("a.c", {}), ("d", 2)]


def test_numbers_of_numpy_are_merged_as_json_holds_them():
    values = {"one": np.float32(0.5), "several": (np.int64(2), math.nan, -math.inf), "group": {"yes": np.bool_(True)}}
    assert json.loads(json.dumps(merged([Metrics(values)]).values, allow_nan=False)) == {
        "one": 0.5, "several": [2, None, None], "group": {"yes": True},
    }  # fmt: skip


def test_what_a_run_was_for_is_said_first():
    driven = Metrics({"m": 1}, headlines=("m",))
    reached = Metrics({"reached": 1}, headlines=("reached",), foremost=True)
    assert merged([driven, reached]).headlines == ("reached", "m")
    assert merged([reached, driven]).headlines == ("reached", "m")

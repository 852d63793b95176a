"""What an experiment's file describes."""

import made_experiments
import pytest

from omninav.pipeline.experiment.specification import read_experiment, value_of
from omninav.pipeline.graph.problems import ProblemsFound

FILE = made_experiments.FILE | {
    "sweep": {"method": {"a": "x=1", "b": "x=2"}, "data": {"first": "y=1", "second": "y=2"}},
    "page": {"rows": ["data"], "columns": "method"},
}


def test_conditions_are_all_combinations_but_those_left_out():
    file = FILE | {"without": [{"method": "b", "data": "first"}]}
    found = read_experiment(file, "full").conditions()
    assert [condition.overrides for condition in found] == ["x=1 y=1", "x=1 y=2", "x=2 y=2"]


def test_overrides_may_be_a_list_of_words():
    listed = {
        "set": ["start=truth", "x.y=[1, 2]"],
        "common": ["seed=1"],
        "sweep": {"method": {"a": ["x=1", "z=2"], "b": "x=2"}, "data": {"first": [], "second": "y=2"}},
    }
    found = read_experiment(FILE | listed, "full")
    assert (found.set, found.common) == ("start=truth 'x.y=[1, 2]'", "seed=1")
    overrides = [condition.overrides.strip() for condition in found.conditions()]
    assert overrides == ["x=1 z=2", "x=1 z=2 y=2", "x=2", "x=2 y=2"]
    for wrong in ({"set": {"start": "truth"}}, {"set": [{"start": "truth"}]}):
        with pytest.raises(ProblemsFound, match=r"experiment\.set: .*\n.*write what one would type: set: start=truth"):
            read_experiment(FILE | wrong, "full")
    with pytest.raises(ProblemsFound, match=r"experiment\.page\.columns: .*\n.*write it in the experiment's file"):
        read_experiment(FILE | {"page": {"rows": ["data", "method"]}}, "full")


def test_a_profile_changes_mappings_key_by_key_and_null_takes_a_label_out():
    file = FILE | {"profiles": {"quick": {"sweep": {"data": {"first": "y=9", "second": None}}, "repetitions": 2}}}
    quick = read_experiment(file, "quick")
    assert [condition.overrides for condition in quick.conditions()] == ["x=1 y=9", "x=2 y=9"]
    assert quick.repetitions == 2


def test_a_profile_has_claims_of_its_own_since_they_name_its_labels():
    quick = {"claims": {"small": {"statement": "s", "measure": "error", "below": 1.0}}}
    claims = {"a": {"statement": "s", "measure": "error", "at_most": 1.0}}
    file = FILE | {"claims": claims, "profiles": {"quick": quick}}
    assert list(read_experiment(file, "quick").claims) == ["small"]
    assert list(read_experiment(file, "full").claims) == ["a"]


def faults(change: dict[str, object], profile: str = "full") -> list[str]:
    """What is said of a file with these entries: where, and what is wrong."""
    try:
        read_experiment(FILE | change, profile)
    except ProblemsFound as error:
        return [f"{problem.where}: {problem.what}" for problem in error.problems]
    return []


ERROR = FILE["measures"]["error"]
CURVE = {"title": "t", "x_label": "x", "path": "p"}
UNSOURCED = "a place in a paper, expected `paper` beside it, and `source` of the experiment"
CLAIM = {"statement": "s", "measure": "error", "at_most": 1.0}


@pytest.mark.parametrize(
    ("change", "problem"),
    [
        ({"page": FILE["page"] | {"along": "x"}}, "experiment.page.along: there is no 'x'"),
        ({"page": FILE["page"] | {"panels": "x"}}, "experiment.page.panels: there is no 'x'"),
        ({"page": FILE["page"] | {"drawn": ["error", "x"]}}, "experiment.page.drawn[1]: there is no 'x'"),
        ({"page": {"rows": ["data", "x"], "columns": "method"}}, "experiment.page.rows: there is no 'x'"),
        ({"curves": [CURVE, CURVE | {"only": {"x": "a"}}]}, "experiment.curves[1].only: there is no 'x'"),
        ({"curves": [CURVE | {"only": {"data": "x"}}]}, "experiment.curves[0].only.data: there is no 'x'"),
        ({"curves": [CURVE, CURVE | {"panels": "x"}]}, "experiment.curves[1].panels: there is no 'x'"),
        ({"without": [{"data": "x"}]}, "experiment.without[0].data: there is no 'x'"),
        ({"claims": {"a": CLAIM | {"measure": "x"}}}, "experiment.claims.a.measure: there is no 'x'"),
        ({"claims": {"a": CLAIM, "b": CLAIM | {"of": {"data": "x"}}}}, "experiment.claims.b.data: there is no 'x'"),
        ({"claims": {"a": CLAIM | {"of": {"x": "a"}}}}, "experiment.claims.a: there is no 'x'"),
        ({"claims": {"a": CLAIM | {"ratio_to": {"x": "a"}}}}, "experiment.claims.a: there is no 'x'"),
        ({"claims": {"a": CLAIM | {"at_most": {"data": "x"}}}}, "experiment.claims.a.data: there is no 'x'"),
        (
            {"claims": {"a": CLAIM | {"where": "Table 1", "paper": "so it is"}}},
            "experiment.claims.a.where: " + UNSOURCED,
        ),
        (
            {"source": "A paper 2004", "claims": {"a": CLAIM | {"where": "Table 1"}}},
            "experiment.claims.a.where: " + UNSOURCED,
        ),
        ({"claims": [CLAIM]}, "experiment.claims: a list, expected a mapping: a key for each claim"),
        (
            {"page": {"rows": [], "columns": "method"}},
            "experiment.page: data: each factor of the sweep is a row or the column of the table",
        ),
        ({"measures": {"error": ERROR | {"of": ["x"]}}}, "experiment.measures.error.of: Measure has no parameter 'of'"),
        ({"repetitions": 0}, "experiment.repetitions: expected at least 1, and at most 100,000"),
        ({"repetitions": 100_001}, "experiment.repetitions: expected at least 1, and at most 100,000"),
        (
            {"sweep": {"method": dict.fromkeys(range(401), ""), "data": dict.fromkeys(range(250), "")}},
            "experiment.sweep: 100,250 conditions, expected at most 100,000",
        ),
        (
            {"scenarios": {"one": "z=1"}, "development": {"one": "z=1"}},
            "experiment.scenarios: 'one' is of development too, which is not judged",
        ),
    ],
)
def test_each_fault_is_named_with_its_place(change: dict[str, object], problem: str):
    assert faults(change) == [problem]


@pytest.mark.parametrize(
    "change",
    [
        {},
        {"repetitions": 1},
        {"repetitions": 100_000},
        {"sweep": {"method": dict.fromkeys(range(400), ""), "data": dict.fromkeys(range(250), "")}},
        {"claims": {"a": CLAIM | {"of": {"data": "first"}, "ratio_to": {"method": "b"}}}},
        {"claims": {"a": CLAIM | {"at_most": "published", "of": {"method": "a"}}}},
        {"page": FILE["page"] | {"along": "data", "panels": "method", "drawn": ["error"]}},
        {"curves": [CURVE | {"panels": "data", "only": {"method": "b"}}]},
    ],
)
def test_a_file_at_its_limits_is_read(change: dict[str, object]):
    assert faults(change) == []


def claim_faults(change: dict[str, object], **measure: object) -> list[str]:
    claim = {"statement": "s", "measure": "error", **change}
    return faults({"measures": {"error": ERROR | measure}, "claims": {"a": claim}})


@pytest.mark.parametrize(
    ("change", "fault"),
    [
        ({}, "a claim makes one comparison"),
        ({"lowest": True, "at_most": 1.0}, "a claim makes one comparison"),
        ({"at_most": 1.0, "at_least": 2.0}, "a claim makes one comparison"),
        ({"at_least": "printed"}, "at_least: 'printed', expected a number"),
        ({"ratio_to": {"method": "b"}, "below": "published"}, "below: a ratio is compared with a number"),
        ({"ratio_to": {"method": "b"}, "below": {"method": "b"}}, "below: a ratio is compared with a number"),
        ({"ratio_to": {"method": "b"}, "lowest": True}, "lowest: a ratio is compared with a number"),
    ],
)
def test_a_claim_makes_one_comparison_that_can_be_made(change: dict[str, object], fault: str):
    (found,) = claim_faults(change)
    assert found.startswith(f"experiment.claims.a: {fault}")


def test_what_is_not_a_mean_is_not_compared_with_conditions():
    other = {"method": "b"}
    assert claim_faults({"below": 1.0}, over_runs="largest") == []
    for change in ({"below": other}, {"lowest": True}, {"ratio_to": other, "below": 1.0}):
        assert claim_faults(change) == []
        (fault,) = claim_faults(change, over_runs="largest")
        assert fault.endswith(": error is the largest of the repetitions, which is compared with a number")


def test_every_seed_runs_in_every_scenario_and_development_by_itself():
    alone = read_experiment(FILE | {"repetitions": 3}, "full")
    assert (alone.runs_of_a_condition, alone.all_scenarios) == (3, {"": ""})
    two = read_experiment(
        FILE | {"repetitions": 3, "scenarios": {"i": "z=1", "ii": "z=2"}, "development": {"iii": "z=0"}}, "full"
    )
    assert two.runs_of_a_condition == 6
    assert list(two.all_scenarios.items()) == [("i", "z=1"), ("ii", "z=2")]
    chosen_on = read_experiment(FILE | {"development": {"iii": "z=0"}}, "full")
    assert chosen_on.all_scenarios == {"iii": "z=0"}


def test_null_takes_a_measure_or_a_scenario_out():
    more = FILE["measures"] | {"time": {"title": "Time", "path": ["time"]}}
    file = FILE | {
        "measures": more,
        "scenarios": {"i": "z=1", "ii": None},
        "profiles": {"quick": {"measures": {"time": None}, "development": {"iii": "z=0"}, "notes": ["few"]}},
    }
    found = read_experiment(file, "quick")
    assert (list(found.measures), list(found.scenarios)) == (["error"], ["i"])
    assert (found.development, found.notes) == ({"iii": "z=0"}, ("few",))
    assert list(read_experiment(file, "full").measures) == ["error", "time"]


def test_a_profile_may_bring_a_mapping_that_the_file_does_not_have():
    file = FILE | {"profiles": {"quick": {"scenarios": {"i": "z=1"}}}}
    assert read_experiment(file, "quick").scenarios == {"i": "z=1"}
    assert faults(file, "quikc") == ["profile: this experiment has no profile 'quikc'"]
    assert faults(file | {"scenarios": ["i"]}, "full")


def test_the_paper_s_figure_of_a_condition_lies_under_its_row_and_column():
    file = FILE | {"published": {"error": {"first": {"a": 3, "b": 1.5}, "second": {"a": "none"}}}}
    found = read_experiment(file, "full")
    figures = [found.published_value("error", condition.labels) for condition in found.conditions()]
    assert figures == [3.0, None, 1.5, None]
    assert found.published_value("time", found.conditions()[0].labels) is None


RESULT = {
    "metrics": {"near": {"error": {"mean": 3.0, "std": 0.5}}, "laps": [4.0, 2.0, 9.0]},
    "timing": {"together": {"match+fuse": {"p50_ms": 7.0}}, "drive": {"seconds": 12.0}},
    "facts": {"images": 30},
}


@pytest.mark.parametrize(
    ("measure", "figure"),
    [
        ({"path": ["near.error.mean"], "scale": 100.0}, 300.0),
        ({"path": ["far.error.mean", "near.error.mean", "facts.images"]}, 3.0),
        ({"path": ["far.error.mean"]}, None),
        ({"path": ["laps"], "aggregate": "max"}, 9.0),
        ({"path": ["laps"], "window": [0.0, 0.6]}, 3.0),
        ({"path": ["timing.drive.seconds"]}, 12.0),
        ({"path": ["facts.images"]}, 30.0),
        ({"path": ["p50_ms"], "stages": ["match", "fuse"]}, 7.0),
        ({"path": ["p50_ms"], "stages": ["fuse"]}, None),
    ],
)
def test_a_measure_is_read_from_metrics_timing_or_facts(measure: dict[str, object], figure: float | None):
    measures = {"error": {"title": "Error", **measure}}
    assert value_of(read_experiment(FILE | {"measures": measures}, "full").measures["error"], RESULT) == figure


def test_what_a_file_leaves_out():
    file = FILE | {"curves": [CURVE], "claims": {"a": CLAIM}}
    found = read_experiment(file, "full")
    error, (curve,), claim = found.measures["error"], found.curves, found.claims["a"]
    assert (found.repetitions, found.shared, found.cores) == (50, True, None)
    assert (error.scale, error.digits, error.aggregate, error.window) == (1.0, 1, "mean", (0.0, 1.0))
    assert (curve.scale, claim.scale, claim.lowest) == (1.0, 1.0, False)

"""Verdicts on claims, from differences that can be worked out by hand."""

import numpy as np
import pytest
from made_experiments import experiment, run_with

from omninav.pipeline.experiment.intervals import bootstrap_interval
from omninav.pipeline.experiment.specification import Measure
from omninav.pipeline.experiment.verdicts import Case, Verdict, headline, judge, key_of, over_runs, unmeasured


def held(claim: dict[str, object], seeds: int = 1, **errors: list[float]) -> bool | None:
    """Whether a claim about the method `a` holds, with these errors of the methods by world, and in each by seed."""
    return judged(claim, seeds, **errors).holds


def judged(
    claim: dict[str, object], seeds: int = 1, over_runs: str = "mean", title: str = "Error", **errors: list[float]
) -> Verdict:
    """The verdict on it. An error of NaN is one that a repetition does not have."""
    claimed = experiment(
        sweep={"method": dict.fromkeys(errors, "")},
        measures={"error": {"title": title, "path": ["error"], "over_runs": over_runs}},
        published={"error": {"a": 10.0}},
        claims={"key": {"statement": "it holds", "measure": "error", "of": {"method": "a"}, **claim}},
    )
    results = {
        key_of({"method": name}): {
            (f"world {n // seeds}", n % seeds): run_with(error=None if np.isnan(value) else value)
            for n, value in enumerate(values)
        }
        for name, values in errors.items()
    }
    return judge(claimed, results)["key"]


CLEAR, ALIKE = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0], [2.0, 1.0, 4.0, 3.0, 6.0, 5.0]
TITLES = {
    "Error (cm)": 5.0,
    "Error (m)": 0.05,
    "Turn (degrees)": 2.0,
    "Lost (%)": 1.0,
    "Lost (further than 2.5 m, %)": 1.0,
    "Time (ms)": 0.75,
    "References": 0.75,
}
FAR = [11.0, 12.0, 13.0, 14.0, 15.0, 16.0]
NEAR = [1.01, 2.01, 3.01, 4.01, 5.01, 6.01]


@pytest.mark.parametrize(
    ("claim", "ours", "theirs", "holds"),
    [
        ({"at_most": 6.5}, CLEAR, FAR, True),
        ({"at_most": 3.5}, CLEAR, FAR, None),
        ({"at_most": 0.5}, CLEAR, FAR, False),
        ({"at_most": 3.5}, [3.5] * 6, FAR, True),
        ({"at_most": "published"}, CLEAR, FAR, True),
        ({"at_most": "published"}, FAR, CLEAR, False),
        ({"at_most": {"method": "b"}, "scale": 20.0}, FAR, CLEAR, True),
        ({"at_most": {"method": "b"}, "scale": 3.5}, FAR, CLEAR, None),
        ({"at_most": {"method": "b"}, "scale": 0.5}, FAR, CLEAR, False),
        ({"at_least": 0.5}, CLEAR, FAR, True),
        ({"at_least": 3.5}, CLEAR, FAR, None),
        ({"at_least": 6.5}, CLEAR, FAR, False),
        ({"at_least": {"method": "b"}}, CLEAR, CLEAR, True),
        ({"below": {"method": "b"}}, CLEAR, FAR, True),
        ({"below": {"method": "b"}}, CLEAR, ALIKE, None),
        ({"below": {"method": "b"}}, FAR, CLEAR, False),
        ({"below": {"method": "b"}}, CLEAR, CLEAR, False),
        ({"below": 7.0}, CLEAR, FAR, True),
        ({"below": "published"}, CLEAR, FAR, True),
        ({"above": {"method": "b"}}, FAR, CLEAR, True),
        ({"above": {"method": "b"}}, CLEAR, ALIKE, None),
        ({"above": {"method": "b"}}, CLEAR, FAR, False),
        ({"above": 0.5}, CLEAR, FAR, True),
        ({"not_above": {"method": "b"}}, NEAR, CLEAR, True),
        ({"not_above": {"method": "b"}}, CLEAR, ALIKE, None),
        ({"not_above": {"method": "b"}}, FAR, CLEAR, False),
        ({"not_above": 3.5}, [3.5, 3.4, 3.6, 3.5, 3.4, 3.6], FAR, True),
        ({"ratio_to": {"method": "b"}, "at_most": 0.5}, CLEAR, FAR, True),
        ({"ratio_to": {"method": "b"}, "at_most": 0.26}, CLEAR, FAR, None),
        ({"ratio_to": {"method": "b"}, "at_most": 0.05}, CLEAR, FAR, False),
        ({"ratio_to": {"method": "b"}, "below": 0.5}, CLEAR, FAR, True),
        ({"ratio_to": {"method": "b"}, "below": 1.0}, CLEAR, ALIKE, None),
        ({"lowest": True}, CLEAR, FAR, True),
        ({"lowest": True}, NEAR, CLEAR, True),
        ({"lowest": True}, CLEAR, ALIKE, None),
        ({"lowest": True}, FAR, CLEAR, False),
    ],
)
def test_each_comparison_says_what_its_figures_say(
    claim: dict[str, object], ours: list[float], theirs: list[float], holds: bool | None
):
    assert held(claim, a=ours, b=theirs) is holds


def test_what_has_not_run_is_not_judged():
    assert held({"below": {"method": "b"}}, a=CLEAR, b=[]) is None


def test_an_interval_on_one_side_decides_however_few_the_scenarios_are():
    spread = [11.0, 12.5, 13.0, 14.5, 15.0]
    assert held({"below": {"method": "b"}}, a=CLEAR[:3], b=spread[:3]) is True
    assert held({"above": {"method": "b"}}, a=CLEAR[:3], b=spread[:3]) is False
    assert held({"below": {"method": "b"}}, a=CLEAR[:2], b=[4.0, 9.0]) is None
    assert held({"below": {"method": "b"}}, a=CLEAR[:1], b=FAR[:1]) is None


def test_equal_figures_of_a_few_scenarios_say_nothing_of_the_next():
    assert held({"at_most": 0.0}, a=[0.0] * 5) is None
    assert held({"at_most": 0.0}, a=[0.0] * 6) is True


def test_a_margin_is_what_matters_to_a_robot_and_not_a_share_of_the_other_side():
    margins = {title: Measure(title, ()).margin_beside(15.0) for title in TITLES}
    assert margins == TITLES
    assert Measure("Growth per lap (cm)", (), margin=1.0).margin_beside(15.0) == 1.0


@pytest.mark.parametrize(("times", "holds"), [(1.04, True), (3.0, False)])
def test_the_margin_of_a_ratio_is_a_share_of_its_limit_whatever_the_unit(times: float, holds: bool):
    claim = {"ratio_to": {"method": "b"}, "not_above": 1.0}
    assert judged(claim, title="Error (cm)", a=[times * each for each in FAR], b=FAR).holds is holds


def test_seeds_do_not_stand_for_scenarios():
    """Sixty seeds in one world decide nothing, and twelve in six worlds do."""
    many = {name: figures[:1] * 60 for name, figures in (("a", CLEAR), ("b", FAR))}
    assert held({"below": {"method": "b"}}, seeds=60, **many) is None
    two = {name: [each for each in figures for _ in range(2)] for name, figures in (("a", CLEAR), ("b", FAR))}
    (case,) = judged({"below": {"method": "b"}}, seeds=2, **two).cases
    assert (case.holds, case.judged, case.scenarios) == (True, 12, 6)


@pytest.mark.parametrize(
    ("claim", "kept", "holds"),
    [
        ({"at_most": 12.0}, 12, True),
        ({"at_most": 11.5}, 11, None),
        ({"below": 12.0}, 11, None),
        ({"at_most": 7.0}, 7, None),
        ({"at_most": 5.0}, 5, False),
    ],
)
def test_a_claim_about_the_worst_run_counts_those_that_keep_to_the_limit(
    claim: dict[str, object], kept: int, holds: bool | None
):
    """Twelve of twelve show that three quarters do; five do not reach them."""
    (case,) = judged(claim, over_runs="largest", a=[float(n) for n in range(1, 13)]).cases
    assert (case.ours, case.kept, case.holds, case.interval) == (12.0, kept, holds, None)


def test_a_verdict_that_holds_without_all_runs_says_in_how_many():
    verdict = judged({"at_most": 59.0}, over_runs="largest", seeds=10, a=[float(n) for n in range(1, 61)])
    assert (verdict.holds, verdict.words) == (True, "holds in 59 of 60 runs")
    assert judged({"at_most": 60.0}, over_runs="largest", seeds=10, a=[1.0] * 60).words == "holds"
    assert judged({"at_most": 5.0}, over_runs="largest", a=[float(n) for n in range(1, 13)]).words == "does not hold"


def test_a_run_without_a_figure_does_not_keep_to_the_limit():
    (case,) = judged({"at_least": 1.0}, over_runs="smallest", a=[*([3.0] * 11), np.nan]).cases
    assert (case.kept, case.judged, case.repetitions, case.holds) == (11, 11, 12, None)


def test_the_best_must_stand_against_every_other():
    """The rival with the lowest mean is all over the place; another one is better every single time."""
    wide = [-50.0, 70.0, -40.0, 60.0, -30.0, 44.0]
    assert np.mean(wide) < 9.5
    assert held({"lowest": True}, a=[10.0] * 6, b=wide, c=[9.0] * 6) is False


def test_a_ratio_is_that_of_the_means_and_its_interval_holds_it():
    (case,) = judged({"ratio_to": {"method": "b"}, "at_most": 0.5}, a=CLEAR, b=FAR).cases
    assert case.ours == pytest.approx(3.5 / 13.5)
    assert case.difference == pytest.approx(3.5 / 13.5 - 0.5)
    low, high = (end + 0.5 for end in case.interval)
    assert low < 3.5 / 13.5 < high


def test_an_interval_decides_however_many_have_a_figure():
    survivors = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0, np.nan]
    verdict = judged({"at_most": 7.0}, a=survivors)
    assert verdict.holds is True
    assert (verdict.cases[0].judged, verdict.cases[0].repetitions) == (6, 7)
    assert held({"at_most": 0.5}, a=survivors) is False
    assert held({"below": {"method": "b"}}, a=survivors, b=[*FAR, 17.0]) is True


def test_a_condition_is_not_compared_with_itself():
    verdict = judged({"of": {}, "at_most": {"method": "b"}}, a=CLEAR, b=FAR)
    assert [case.where for case in verdict.cases] == ["a"]


def test_a_case_says_what_was_compared():
    (case,) = judged({"below": {"method": "b"}, "scale": 0.5}, a=[4.0] * 6, b=[6.0] * 6).cases
    assert case == Case("a", 4.0, 3.0, "0.5 x method b", 1.0, (1.0, 1.0), False, 6, 6, False, 6)
    (case,) = judged({"at_most": {"method": "b"}}, a=[4.0] * 6, b=[6.0] * 6).cases
    assert case == Case("a", 4.0, 6.0, "method b", -2.0, (-2.0, -2.0), True, 6, 6, False, 6)
    (case,) = judged({"at_most": 3.0, "scale": 2.0}, a=[4.0] * 6).cases
    assert case == Case("a", 4.0, 6.0, "the limit", -2.0, (-2.0, -2.0), True, 6, 6, False, 6)
    (case,) = judged({"at_most": "published"}, a=[4.0] * 6).cases
    assert case == Case("a", 4.0, 10.0, "the paper's figure", -6.0, (-6.0, -6.0), True, 6, 6, False, 6)
    (case,) = judged({"ratio_to": {"method": "b"}, "at_least": 0.25}, a=[4.0] * 6, b=[8.0] * 7).cases
    assert case == Case("a / method b", 0.5, 0.25, "the limit", 0.25, (0.25, 0.25), True, 6, 6, True, 6)
    (case,) = judged({"lowest": True}, a=[4.0] * 6, b=[8.0] * 6, c=[5.0] * 6).cases
    assert case == Case("a", 4.0, 5.0, "c", -1.0, (-1.0, -1.0), True, 6, 6, False, 6)


def test_the_interval_of_a_case_is_that_of_its_differences():
    (case,) = judged({"below": {"method": "b"}}, seeds=2, a=[*CLEAR, *FAR], b=[*ALIKE, *FAR]).cases
    differences = np.subtract([*CLEAR, *FAR], [*ALIKE, *FAR])
    assert case.interval == pytest.approx(bootstrap_interval(np.split(differences, 6)))
    assert (case.ours, case.other, case.difference) == (8.5, 8.5, 0.0)
    (case,) = judged({"below": 2.0}, a=CLEAR).cases
    assert case.interval == pytest.approx(np.subtract(bootstrap_interval(np.split(np.array(CLEAR), 6)), 2.0))


def test_what_cannot_be_compared_is_told_as_far_as_it_is_known():
    (case,) = judged({"below": {"method": "b"}}, a=CLEAR, b=[]).cases
    assert case == Case("a", 3.5, None, "method b", None, None, None)
    (case,) = judged({"below": {"method": "b"}}, a=[], b=CLEAR).cases
    assert case == Case("a", None, 3.5, "method b", None, None, None)
    (case,) = judged({"at_most": "published", "of": {"method": "b"}}, a=CLEAR, b=CLEAR).cases
    assert case == Case("b", 3.5, None, "the paper's figure", None, None, None)
    (case,) = judged({"ratio_to": {"method": "b"}, "below": 1.0}, a=CLEAR, b=[0.0] * 6).cases
    assert case == Case("a / method b", None, 1.0, "the limit", None, None, None)
    (case,) = judged({"lowest": True}, a=CLEAR).cases
    assert case == Case("a", 3.5, None, "no other", None, None, None)
    (case,) = judged({"lowest": True}, a=[]).cases
    assert case.ours is None


@pytest.mark.parametrize(
    ("comparison", "by", "holds"),
    [
        ("at_most", 0.0, True),
        ("at_most", 5e-10, True),
        ("at_most", 1e-8, False),
        ("at_least", -5e-10, True),
        ("at_least", -1e-8, False),
        ("below", 0.0, False),
        ("below", -1e-8, True),
        ("above", 0.0, False),
        ("above", 1e-8, True),
        ("not_above", 0.49, True),
        ("not_above", 0.51, False),
    ],
)
def test_a_difference_that_is_rounding_is_none_and_five_percent_are_not_above(comparison: str, by: float, holds: bool):
    assert held({comparison: 10.0}, a=[10.0 + by] * 6) is holds


def test_not_above_is_open_where_the_interval_reaches_beyond_the_margin_or_begins_within_it():
    figures = [9.0, 9.5, 10.0, 10.5, 11.0, 11.0]
    assert [held({"not_above": limit}, a=figures) for limit in (8.0, 10.0, 12.0)] == [False, None, True]
    within = [10.1, 10.2, 10.4, 10.6, 10.9, 11.0]  # by 0.1 to 1.0 above 10: 0.5 is the margin
    assert held({"not_above": 10.0}, a=within) is None
    assert held({"at_most": 10.0}, a=within) is False


def swept(claim: dict[str, object], figures: dict[tuple[str, str], float]) -> list[Case]:
    """The cases of a claim about figures by method and day, each of six worlds."""
    methods, days = (list(dict.fromkeys(labels)) for labels in zip(*figures, strict=True))
    claimed = experiment(
        sweep={"method": dict.fromkeys(methods, ""), "day": dict.fromkeys(days, "")},
        page={"rows": ["day"], "columns": "method"},
        claims={"key": {"statement": "s", "measure": "error", **claim}},
    )
    results = {
        key_of({"method": method, "day": day}): {(f"world {n}", 0): run_with(error=figure) for n in range(6)}
        for (method, day), figure in figures.items()
    }
    return list(judge(claimed, results)["key"].cases)


GRID = {("a", "1"): 1.0, ("a", "2"): 2.0, ("b", "1"): 3.0, ("b", "2"): 1.0, ("c", "1"): 9.0, ("c", "2"): 9.0}


def test_a_claim_has_a_case_for_each_condition_that_it_leaves_open():
    cases = swept({"of": {"method": "a"}, "below": {"method": "b"}}, GRID)
    assert [(case.where, case.ours, case.other, case.holds) for case in cases] == [
        ("a, 1", 1.0, 3.0, True),
        ("a, 2", 2.0, 1.0, False),
    ]
    others = swept({"of": {"day": "1"}, "below": {"method": "b"}}, GRID)
    assert [(case.where, case.against) for case in others] == [("a, 1", "method b"), ("c, 1", "method b")]
    ratios = swept({"of": {"day": "1"}, "ratio_to": {"method": "b", "day": "2"}, "below": 2.0}, GRID)
    assert [case.where for case in ratios] == ["a, 1 / method b, day 2", "b, 1 / day 2", "c, 1 / method b, day 2"]


def test_the_lowest_is_so_among_conditions_that_differ_in_the_claim_s_factors_or_in_those_it_names():
    cases = swept({"of": {"method": "a"}, "lowest": True}, GRID)
    assert [(case.where, case.against, case.holds) for case in cases] == [("a, 1", "b", True), ("a, 2", "b", False)]
    (case,) = swept({"of": {"method": "a", "day": "1"}, "lowest": True, "among": ["day"]}, GRID)
    assert (case.where, case.against, case.difference) == ("a, 1", "2", -1.0)
    (case,) = swept({"of": {"method": "b", "day": "1"}, "lowest": True}, GRID)
    assert (case.against, case.holds) == ("a, 1", False)


def test_a_verdict_holds_where_all_of_its_cases_do():
    yes, no, open_ = (Case("x", 1.0, 2.0, "the limit", -1.0, (-1.5, -0.5), holds) for holds in (True, False, None))
    found = [Verdict(cases).holds for cases in ((yes, yes), (yes, open_), (open_, no), ())]
    assert found == [True, None, False, None]


@pytest.mark.parametrize(
    ("found", "words"),
    [
        ([True], "holds"),
        ([False], "does not hold"),
        ([None], "undecided"),
        ([True, True], "holds"),
        ([None, None], "undecided"),
        ([False, False], "0 of 2 hold"),
        ([True, False], "1 of 2 hold"),
        ([True, True, False], "2 of 3 hold"),
        ([True, None, False], "1 of 3 hold, 1 undecided"),
        ([None, True, False, None], "1 of 4 hold, 2 undecided"),
    ],
)
def test_the_headline_of_a_page_follows_from_its_claims(found: list[bool | None], words: str):
    verdicts = [Verdict((Case("x", 1.0, 2.0, "", -1.0, None, holds),)) for holds in found]
    assert headline(verdicts) == words


def test_of_the_runs_the_mean_counts_or_the_largest_or_the_smallest():
    for name, figure in (("mean", 3.0), ("largest", 5.0), ("smallest", 1.0)):
        assert over_runs(Measure("Error", ("error",), over_runs=name), iter([5.0, 1.0, 3.0])) == figure


def test_means_are_compared_and_not_medians():
    (case,) = judged({"below": {"method": "b"}}, a=[1.0, 1.0, 1.0, 1.0, 1.0, 13.0], b=[2.0] * 5 + [32.0]).cases
    assert (case.ours, case.other, case.difference) == pytest.approx((3.0, 7.0, -4.0))
    (case,) = judged({"below": {"method": "b"}}, a=[1.0, 1.0, 4.0], b=[]).cases
    assert case.ours == 2.0


def test_five_percent_of_a_negative_figure_are_as_much_as_of_a_positive_one():
    for ours, theirs, holds in ((-9.6, -10.0, True), (-9.4, -10.0, False), (10.4, 10.0, True), (10.51, 10.0, False)):
        assert held({"not_above": theirs}, a=[ours] * 6) is holds
        assert held({"not_above": {"method": "b"}}, a=[ours] * 6, b=[theirs] * 6) is holds


def test_a_ratio_is_of_repetitions_that_have_both_figures():
    (case,) = judged(
        {"ratio_to": {"method": "b"}, "below": 1.0}, a=[1.0] * 7, b=[2.0, 2.0, 2.0, 2.0, 2.0, 2.0, np.nan]
    ).cases
    assert (case.ours, case.judged, case.repetitions, case.holds) == (0.5, 6, 7, True)


def test_of_the_rivals_of_the_best_the_closest_call_is_shown_and_what_fails_or_is_open_first():
    best, wide = [10.0] * 6, [-50.0, 70.0, -40.0, 60.0, -30.0, 68.0]

    def shown(**rivals: list[float]) -> tuple[str, bool | None]:
        (case,) = judged({"lowest": True}, a=best, **rivals).cases
        return case.against, case.holds

    assert shown(b=[15.0] * 6, c=[11.0] * 6, d=[12.0] * 6) == ("c", True)
    assert shown(b=[11.0] * 6, c=wide) == ("c", None)  # 13 on average, and it may be anything
    assert shown(b=wide, c=[9.0] * 6, d=[8.0] * 6) == ("d", False)
    assert shown(b=[each - 3.5 for each in wide], c=[]) == ("b", None)  # 0.5 below
    assert shown(b=[each - 2.5 for each in wide], c=[]) == ("c", None)  # 0.5 above, where c is not known


def test_figures_that_are_zero_together_have_a_ratio_where_they_are_not_zero_each():
    (case,) = judged(
        {"ratio_to": {"method": "b"}, "below": 1.0}, a=[1.0] * 6, b=[-1.0, 0.0, -1.0, -1.0, -1.0, -1.0]
    ).cases
    assert case.ours == pytest.approx(-1.2)


def test_a_measure_that_no_run_has_is_named_with_what_is_like_it():
    tried = experiment(
        sweep={"method": {"a": ""}}, measures={name: {"title": "E", "path": [name]} for name in ("eror", "drift")}
    )
    results = {key_of({"method": "a"}): {("", 0): run_with(error=1.0), ("", 1): run_with(error=1.0, drift=2.0)}}
    assert [str(problem).split("\n")[0] for problem in unmeasured(tried, results)] == [
        "experiment.measures.eror.path: no run has eror"
    ]
    assert not [*unmeasured(tried, {})]

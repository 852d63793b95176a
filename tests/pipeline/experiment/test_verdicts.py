"""Verdicts on claims, from differences that can be worked out by hand."""

import numpy as np
import pytest

from omninav.pipeline.experiment.specification import read_experiment
from omninav.pipeline.experiment.verdicts import Verdict, judge, key_of, pooled
from omninav.pipeline.graph.problems import ProblemsFound


def held(claim: dict[str, object], seeds: int = 1, **errors: list[float]) -> bool | None:
    """Whether a claim about the method `a` holds, with these errors of the methods by world, and in each by seed."""
    return judged(claim, seeds, **errors).holds


def judged(claim: dict[str, object], seeds: int = 1, over_runs: str = "mean", **errors: list[float]) -> Verdict:
    """The verdict on it. An error of NaN is one that a repetition does not have."""
    file = {
        "name": "test",
        "title": "A test",
        "about": "",
        "variant": "none",
        "sweep": {"method": dict.fromkeys(errors, "")},
        "measures": {"error": {"title": "Error", "path": ["error"], "over_runs": over_runs}},
        "page": {"rows": [], "columns": "method"},
        "published": {"error": {"a": 10.0}},
        "claims": [{"statement": "it holds", "measure": "error", "of": {"method": "a"}, **claim}],
    }
    results = {
        key_of({"method": name}): {
            (f"world {n // seeds}", n % seeds): {
                "metrics": {"error": None if np.isnan(value) else value},
                "timing": {},
                "facts": {},
            }
            for n, value in enumerate(values)
        }
        for name, values in errors.items()
    }
    (verdict,) = judge(read_experiment(file, "paper"), results)
    return verdict


CLEAR, ALIKE = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0], [2.0, 1.0, 4.0, 3.0, 6.0, 5.0]
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


def test_a_handful_of_scenarios_decides_nothing():
    assert held({"below": {"method": "b"}}, a=CLEAR[:5], b=FAR[:5]) is None


def test_seeds_do_not_stand_for_scenarios():
    """Sixty seeds in five worlds decide nothing, and twelve in six worlds do."""
    many = {name: [each for each in figures[:5] for _ in range(12)] for name, figures in (("a", CLEAR), ("b", FAR))}
    assert held({"below": {"method": "b"}}, seeds=12, **many) is None
    two = {name: [each for each in figures for _ in range(2)] for name, figures in (("a", CLEAR), ("b", FAR))}
    (case,) = judged({"below": {"method": "b"}}, seeds=2, **two).cases
    assert (case.holds, case.judged, case.scenarios) == (True, 12, 6)


@pytest.mark.parametrize(
    ("over_runs", "claim", "ours", "holds"),
    [
        ("largest", {"at_most": 6.0}, 6.0, True),
        ("largest", {"at_most": 5.9}, 6.0, False),
        ("largest", {"below": 6.0}, 6.0, False),
        ("smallest", {"at_least": 1.0}, 1.0, True),
        ("smallest", {"at_least": 1.1}, 1.0, False),
    ],
)
def test_a_largest_figure_is_that_of_the_worst_run(over_runs: str, claim: dict[str, object], ours: float, holds: bool):
    (case,) = judged(claim, over_runs=over_runs, a=CLEAR).cases
    assert (case.ours, case.holds, case.interval) == (ours, holds, None)


def test_a_largest_figure_is_compared_with_a_number():
    with pytest.raises(ProblemsFound, match="which is compared with a number"):
        judged({"below": {"method": "b"}}, over_runs="largest", a=CLEAR, b=FAR)


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


def test_a_claim_about_survivors_does_not_hold_but_it_may_fail():
    survivors = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0, np.nan]
    verdict = judged({"at_most": 7.0}, a=survivors)
    assert verdict.holds is None
    assert (verdict.cases[0].judged, verdict.cases[0].repetitions) == (6, 7)
    assert held({"at_most": 0.5}, a=survivors) is False
    assert held({"below": {"method": "b"}}, a=survivors, b=[*FAR, 17.0]) is None
    assert held({"below": {"method": "b"}}, a=survivors[:6], b=[*FAR, 17.0]) is True  # the seventh has not run yet


def test_a_condition_is_not_compared_with_itself():
    verdict = judged({"of": {}, "at_most": {"method": "b"}}, a=CLEAR, b=FAR)
    assert [case.where for case in verdict.cases] == ["a"]


@pytest.mark.parametrize(
    ("claim", "said"),
    [
        ({"below": "publisht"}, "expected a number"),
        ({"below": 1.0, "above": 2.0}, "makes one comparison"),
        ({"ratio_to": {"method": "b"}, "below": {"method": "b"}}, "a ratio is compared with a number"),
        ({"ratio_to": {"method": "c"}, "below": 1.0}, "there is no 'c'"),
    ],
)
def test_a_claim_that_says_nothing_clear_is_refused(claim: dict[str, object], said: str):
    with pytest.raises(ProblemsFound, match=said):
        held(claim, a=CLEAR, b=FAR)


def test_a_pooled_deviation_is_over_all_frames_of_all_repetitions_and_nothing_is_judged_by_it():
    runs = [np.array([1.0, 2.0, 3.0]), np.array([7.0, 9.0])]
    file = {
        "name": "test",
        "title": "A test",
        "about": "",
        "variant": "none",
        "sweep": {"method": {"a": ""}},
        "measures": {"sigma": {"title": "Sigma", "path": ["late.error"], "pooled": True, "scale": 100.0}},
        "page": {"rows": [], "columns": "method"},
    }
    results = {
        key_of({"method": "a"}): {
            ("", seed): {
                "metrics": {"late": {"error": {"mean": run.mean(), "std": run.std()}, "frames": len(run)}},
                "timing": {},
                "facts": {},
            }
            for seed, run in enumerate(runs)
        }
    }
    found = pooled(read_experiment(file, "paper"), results, "sigma", {"method": "a"})
    assert found == pytest.approx(100 * np.concatenate(runs).std())
    with pytest.raises(ProblemsFound, match="pooled"):
        read_experiment(file | {"claims": [{"statement": "small", "measure": "sigma", "at_most": 1.0}]}, "paper")

"""Verdicts on claims, from differences that can be worked out by hand."""

import numpy as np
import pytest

from omninav.pipeline.experiment import read_experiment
from omninav.pipeline.verdicts import bootstrap_interval, judge, key_of


def held(claim: dict[str, object], **errors: list[float]) -> bool | None:
    """Whether a claim about the method `a` holds, with these errors of the methods by seed."""
    file = {
        "name": "test",
        "title": "A test",
        "about": "",
        "variant": "none",
        "sweep": {"method": dict.fromkeys(errors, "")},
        "measures": {"error": {"title": "Error", "of": ["error"]}},
        "page": {"rows": [], "columns": "method"},
        "published": {"error": {"a": 10.0}},
        "claims": [{"says": "it holds", "measure": "error", "of": {"method": "a"}, **claim}],
    }
    results = {
        key_of({"method": name}): {
            seed: {"metrics": {"error": value}, "timing": {}, "facts": {}} for seed, value in enumerate(values)
        }
        for name, values in errors.items()
    }
    (verdict,) = judge(read_experiment(file, "paper"), results)
    return verdict.holds


CLEAR, ALIKE = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0], [2.0, 1.0, 4.0, 3.0, 6.0, 5.0]
FAR = [11.0, 12.0, 13.0, 14.0, 15.0, 16.0]
NEAR = [1.01, 2.01, 3.01, 4.01, 5.01, 6.01]


def test_a_constant_difference_has_an_interval_of_no_width():
    assert bootstrap_interval(np.full(5, 2.5)) == (2.5, 2.5)


def test_the_interval_of_a_mean_is_the_normal_one_for_many_values():
    values = np.random.default_rng(1).normal(3.0, 2.0, 400)
    low, high = bootstrap_interval(values)
    half = 1.96 * values.std() / np.sqrt(400)
    assert low == pytest.approx(values.mean() - half, abs=0.03)
    assert high == pytest.approx(values.mean() + half, abs=0.03)


@pytest.mark.parametrize(
    ("claim", "ours", "theirs", "holds"),
    [
        ({"at_most": 3.5}, CLEAR, FAR, True),
        ({"at_most": 3.4}, CLEAR, FAR, False),
        ({"at_most": "published"}, CLEAR, FAR, True),
        ({"at_most": "published"}, FAR, CLEAR, False),
        ({"at_most": {"method": "b"}, "times": 5.0}, FAR, CLEAR, True),
        ({"at_most": {"method": "b"}, "times": 3.5}, FAR, CLEAR, False),
        ({"below": {"method": "b"}}, CLEAR, FAR, True),
        ({"below": {"method": "b"}}, CLEAR, ALIKE, False),
        ({"above": {"method": "b"}}, FAR, CLEAR, True),
        ({"above": {"method": "b"}}, CLEAR, ALIKE, False),
        ({"not_above": {"method": "b"}}, NEAR, CLEAR, True),
        ({"not_above": {"method": "b"}}, CLEAR, ALIKE, None),
        ({"not_above": {"method": "b"}}, FAR, CLEAR, False),
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


def test_a_handful_of_repetitions_decides_nothing():
    assert held({"below": {"method": "b"}}, a=CLEAR[:5], b=FAR[:5]) is None


def test_the_best_must_stand_against_every_other():
    """The rival with the lowest mean is all over the place; another one is better every single time."""
    wide = [-50.0, 70.0, -40.0, 60.0, -30.0, 44.0]
    assert np.mean(wide) < 9.5
    assert held({"lowest": True}, a=[10.0] * 6, b=wide, c=[9.0] * 6) is False

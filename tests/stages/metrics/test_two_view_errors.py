import math

import numpy as np
import pytest
from measured_drives import figures

from omninav.stages.metrics.two_view_errors import TwoViewErrors
from omninav.stages.values.two_views import RelativeView


def view(turn_deg, way_deg, samples=0, axis=2):
    cos, sin = math.cos(math.radians(turn_deg)), math.sin(math.radians(turn_deg))
    one, other = {0: (1, 2), 1: (2, 0), 2: (0, 1)}[axis]
    rotation = np.eye(3)
    rotation[[one, one, other, other], [one, other, one, other]] = cos, -sin, sin, cos
    way = np.array([math.cos(math.radians(way_deg)), math.sin(math.radians(way_deg)), 0.0])
    return RelativeView(rotation, way, np.ones(5, bool), samples)


def errors(truth, found):
    return figures(TwoViewErrors(), truth, found)["two_views"]


def test_both_angles_must_be_small_for_a_problem_to_be_solved():
    truth = [view(30.0, 40.0)] * 5
    found = [view(31.0, 42.0, 10), view(34.0, 40.0, 20), view(30.0, 50.0, 60), view(32.0, 39.0, 30), None]
    measured = errors(truth, found)
    assert measured["success_rate"] == pytest.approx(2 / 5)
    assert measured["rotation_error_deg"]["median"] == pytest.approx(1.5)
    assert measured["rotation_error_deg"]["p95"] == pytest.approx(np.percentile([1.0, 4.0, 0.0, 2.0], 95))
    assert measured["direction_error_deg"]["median"] == pytest.approx(1.5)
    assert measured["direction_error_deg"]["p95"] == pytest.approx(np.percentile([2.0, 0.0, 10.0, 1.0], 95))
    assert measured["samples"] == 25.0


@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("turn", [0.0, 70.0, -110.0, 180.0])
def test_a_turn_is_measured_about_any_axis(axis, turn):
    measured = errors([view(0.0, 0.0)], [view(turn, 180.0, axis=axis)])
    assert measured["rotation_error_deg"]["median"] == pytest.approx(abs(turn), abs=1e-5)
    assert measured["direction_error_deg"]["median"] == pytest.approx(180.0)
    assert measured["success_rate"] == 0.0


def test_three_degrees_are_allowed_and_an_error_at_the_limit_too(monkeypatch: pytest.MonkeyPatch):
    assert errors([view(0.0, 0.0)] * 2, [view(2.9, 2.9), view(3.1, 0.0)])["success_rate"] == 0.5
    monkeypatch.setattr("omninav.stages.metrics.two_view_errors.WITHIN_DEG", 90.0)
    assert errors([view(0.0, 0.0)], [view(90.0, 90.0)])["success_rate"] == 1.0


def test_where_nothing_was_solved_or_asked_there_are_no_figures():
    unsolved = errors([view(0.0, 0.0)], [None])
    assert unsolved == {
        "success_rate": 0.0,
        "rotation_error_deg": {"median": None, "p95": None},
        "direction_error_deg": {"median": None, "p95": None},
        "samples": None,
    }
    assert errors([], [])["success_rate"] is None

"""Figures out of nested results, worked by hand."""

import pytest

from omninav.pipeline.experiment.series import aggregated, at, series_at, value_at

RESULT = {
    "error_m": {"mean": 2.0},
    "logs": [{"error_m": {"mean": 3.0}}, {"error_m": {"mean": 1.0}}],
    "laps": [{"error_m": {"mean": 0.4}}, {"frames": 3}, {"error_m": {"mean": 0.1}}],
    "growth": {"references": [10, 20, 30, 31]},
}


def test_a_path_leads_through_names_numbers_and_stars():
    assert at(RESULT, "error_m.mean") == 2.0
    assert at(RESULT, "logs.-1.error_m.mean") == 1.0
    assert at(RESULT, "logs.-2.error_m.mean") == 3.0
    assert at(RESULT, "logs.2.error_m.mean") is at(RESULT, "logs.-3.error_m.mean") is None
    assert at(RESULT, "logs.first") is None
    assert series_at(RESULT, "laps.*.error_m.mean") == [0.4, None, 0.1]
    assert series_at(RESULT, "growth.references") == [10.0, 20.0, 30.0, 31.0]
    assert series_at(RESULT, "error_m") == series_at(RESULT, "nothing.*.there") == []


@pytest.mark.parametrize(
    ("take", "figure"),
    [
        ("mean", 22.75),
        ("median", 25.0),
        ("min", 10.0),
        ("max", 31.0),
        ("first", 10.0),
        ("last", 31.0),
        ("change", 21.0),
        ("ratio", 3.1),
        ("slope", 7.3),  # entries -1.5, -0.5, 0.5, 1.5 off their middle: (-15 - 10 + 15 + 46.5) / 5
        ("largest_rise", 10.0),
    ],
)
def test_what_is_taken_of_a_series(take, figure):
    assert value_at(RESULT, "growth.references", take) == pytest.approx(figure)


def test_a_part_of_a_series_counts_from_its_start():
    assert value_at(RESULT, "growth.references", "change", (0.5, 1.0)) == 1.0
    assert value_at(RESULT, "growth.references", "mean", (0.0, 0.5)) == 15.0


def test_an_entry_that_lies_partly_in_the_window_counts():
    series = [1.0, 2.0, 4.0, 8.0, 16.0]
    assert aggregated(series, "first", (0.3, 0.7)) == 2.0
    assert aggregated(series, "last", (0.3, 0.7)) == 8.0
    assert aggregated(series, "mean") == pytest.approx(6.2)


def test_a_window_that_ends_between_two_entries_is_exact():
    assert aggregated(range(100), "last", (0.0, 0.07)) == 6.0
    assert aggregated(range(100), "first", (0.29, 1.0)) == 29.0


def test_one_entry_is_enough_where_nothing_is_compared():
    assert [aggregated([None, 7.0], take) for take in ("mean", "max", "first", "last")] == [7.0] * 4
    assert aggregated([3.0, None, 7.0], "change") == 4.0


def test_what_is_no_number_is_not_there():
    series = [True, "3", float("nan"), float("inf"), 2, None]
    assert series_at({"a": series}, "a") == [None, None, None, None, 2.0, None]
    assert value_at({"a": True}, "a") is None
    assert value_at({"a": series}, "a") == 2.0


def test_entries_that_are_not_there_are_left_out_and_too_few_give_nothing():
    assert value_at(RESULT, "laps.*.error_m.mean", "slope") == pytest.approx(-0.15)
    assert aggregated([None, 1.0], "change") is None
    assert aggregated([None], "mean") is None
    assert aggregated([0.0, 1.0], "ratio") is None


def test_paths_joined_by_plus_are_added_and_one_that_is_missing_leaves_none():
    assert value_at(RESULT, "error_m.mean + logs.0.error_m.mean") == 5.0
    assert value_at(RESULT, "error_m.mean + logs.5.error_m.mean") is None

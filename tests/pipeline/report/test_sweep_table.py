import csv

import pytest
from sample_metrics import measured, sweep_row

from omninav.pipeline.report.sweep_table import conditions, mean_of, write_sweep_tables


def rows(*losses):
    metrics = (None if loss is None else measured(loss_rate=loss) for loss in losses)
    return [sweep_row(n, each, overrides=f"gain={n // 3} seed={n % 3}") for n, each in enumerate(metrics)]


def test_the_interval_of_a_mean_is_students():
    found = mean_of([1.0, 2.0, 3.0])
    assert (found.mean, found.high - found.mean) == pytest.approx((2.0, 4.302653 / 3**0.5), abs=1e-5)
    assert mean_of([5.0]) == type(found)(5.0, None, None)


def test_an_interval_ends_where_no_figure_can_be():
    assert mean_of([0.1, 0.3]).low == 0.0
    assert mean_of([-0.1, 0.3]).low < -2.0
    (rates,) = conditions(rows(0.8, 1.0))
    assert (rates.means["loss_rate"].low, rates.means["loss_rate"].high) == (0.0, 1.0)


def test_means_are_over_the_seeds_of_each_condition_and_failed_jobs_are_left_out():
    first, second = conditions(rows(0.1, 0.2, 0.3, 0.5, None, 0.7))
    assert (first.settings, first.jobs, first.means["loss_rate"].mean) == ({"gain": "0"}, 3, pytest.approx(0.2))
    assert (second.settings, second.jobs, second.means["loss_rate"].mean) == ({"gain": "1"}, 2, pytest.approx(0.6))


def test_a_value_with_spaces_is_whole_and_older_sweeps_are_read():
    words = [["map='a b/one.omap'", "seed=0"], ["map='a b/two.omap'", "seed=0"], "gain=1 seed=0"]
    typed = [sweep_row(n, measured(loss_rate=0.1), overrides=overrides) for n, overrides in enumerate(words)]
    assert [each.settings for each in conditions(typed)] == [
        {"map": "'a b/one.omap'"},
        {"map": "'a b/two.omap'"},
        {"gain": "1"},
    ]


def test_both_tables_are_files(tmp_path):
    write_sweep_tables(tmp_path, rows(0.1, 0.2, 0.3, None))
    jobs, means = (list(csv.DictReader((tmp_path / f"{name}.csv").open())) for name in ("sweep", "sweep_means"))
    assert [(job["job"], job["gain"], job["seed"], job["loss_rate"]) for job in jobs][2:] == [
        ("2", "0", "2", "0.3"),
        ("3", "1", "0", ""),
    ]
    assert [(mean["gain"], mean["jobs"]) for mean in means] == [("0", "3"), ("1", "0")]
    assert float(means[0]["loss_rate.low"]) < float(means[0]["loss_rate"]) < float(means[0]["loss_rate.high"])

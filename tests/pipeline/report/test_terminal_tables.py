import io

from rich.console import Console
from sample_metrics import measured

from omninav.pipeline import Metrics, Quantity
from omninav.pipeline.report.terminal_tables import compare_table, differing_settings, results_table


def printed(table) -> str:
    console = Console(width=140, record=True, file=io.StringIO())
    console.print(table)
    return console.export_text()


def test_results_have_units_and_no_details():
    table = printed(results_table(measured()))
    for expected in ("Position error (m)", "0.073", "Loss rate (%)", "12 frames", "168 kB"):
        assert expected in table
    assert "odometry alone" not in table
    assert "Frames" in printed(results_table(Metrics({"frames": 3})))


def test_a_comparison_marks_the_best_and_shows_differing_settings():
    runs = [
        {"name": "runs/a", "metrics": measured(), "config": {"seed": 0, "nodes": {"m": {"k": 1}}}, "manifest": {}},
        {
            "name": "runs/b",
            "metrics": measured(loss_rate=0.0, frames=10),
            "config": {"seed": 1, "nodes": {"m": {"k": 1}}},
            "manifest": {},
        },
    ]
    lines = printed(compare_table(runs)).splitlines()
    loss = next(line for line in lines if "Loss rate (%)" in line)
    assert "0 *" in loss
    assert "12.5 *" not in loss
    assert "*" not in next(line for line in lines if line.startswith("│ Frames"))
    assert any(line.strip("│ ").startswith("seed ") for line in lines)
    assert not any("m.k" in line for line in lines)
    assert not any("odometry alone" in line for line in lines)


def test_where_more_is_better_the_largest_is_marked():
    described = {"goal.reached_rate": Quantity(better="higher"), "goal.end_error_m": Quantity(better="lower")}
    runs = [
        {
            "name": f"runs/{share}",
            "metrics": Metrics({"goal": {"reached_rate": share, "end_error_m": 2.0 - share}}, described),
            "config": {},
            "manifest": {},
        }
        for share in (1.0, 0.0)
    ]
    lines = printed(compare_table(runs)).splitlines()
    for what, best in (("Reached rate", "100 *"), ("End error", "1.00 *")):
        assert best in next(line for line in lines if what in line)


def test_runs_with_long_names_stand_under_letters_that_are_explained():
    names = [f"runs/2026-01-0{day}_10-00-00_omniview_mcl" for day in (1, 2, 3)]
    said = printed(compare_table([{"name": n, "metrics": measured(), "config": {}, "manifest": {}} for n in names]))
    assert [said.count(name) for name in names] == [1, 1, 1]
    assert f"B: {names[1]}" in said


def test_settings_that_one_run_does_not_have_differ_too():
    assert differing_settings([{"a": 1, "b": {"c": 2}}, {"a": 1}]) == [("b.c", ["2", "–"])]

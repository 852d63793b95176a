import io

from rich.console import Console
from rich.control import Control
from rich.text import Text
from sample_metrics import compared, measured, sweep_row

from omninav.pipeline import Metrics, MetricSpec
from omninav.pipeline.report.sweep_table import overview_of
from omninav.pipeline.report.terminal_tables import (
    compare_table,
    differing_settings,
    key_table,
    results_table,
    sweep_table,
)
from omninav.pipeline.report.terminal_text import PlainTexts, plain


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


def test_each_figure_of_a_run_is_one_line_with_what_is_off_in_colour():
    described = {"lost_rate": MetricSpec(title="Lost [at all]", most=0.0), "error_m": MetricSpec()}
    metrics = Metrics({"lost_rate": 0.5, "error_m": 0.2}, described, ("error_m", "lost_rate"))
    for width in (80, 120):
        said = io.StringIO()
        Console(width=width, file=said, color_system="standard", force_terminal=True).print(key_table(metrics, {}))
        error, lost = said.getvalue().splitlines()
        assert error.split() == ["Error", "0.200", "m"]
        assert "Lost [at all]" in lost
        assert "\x1b[1;31m50.0 %" in lost
        assert "\x1b[" not in error
    assert "\x1b" not in printed(key_table(metrics, {}))


def test_no_two_rows_of_the_results_have_one_name_and_none_is_empty():
    described = {"error_m": MetricSpec(title="Error"), "found_again": MetricSpec()}
    described |= {"smoothed.loss_rate": MetricSpec(title="Lost, smoothed")}
    spread = {"mean": 0.2, "max": 3.0}
    values = {"error_m": spread, "loss_rate": 0.1, "found_again": None}
    values |= {"smoothed": {"error_m": spread, "loss_rate": 0.2}, "rotation": {"error_deg": spread}}
    lines = [line for line in printed(results_table(Metrics(values, described))).splitlines() if line[:1] == "│"]
    names = [line.split("│")[1].strip() for line in lines]
    assert sorted(names) == sorted({*names})
    assert names == ["Error (m)", "all frames", "smoothed", "Error, rotation (°)", "Loss rate", "Lost, smoothed"]
    assert all(any(cell.strip() for cell in line.split("│")[2:]) for line in lines if "Error (m)" not in line)


def test_a_sweep_shows_what_varies_and_as_many_figures_as_fit():
    figures = tuple(f"figure_{i}_m" for i in range(9))
    rows = []
    for n in range(4):
        metrics = Metrics({figure: 0.1 * n + i for i, figure in enumerate(figures)}, headlines=figures)
        rows.append(sweep_row(n, metrics, overrides=f"variant=a ++nodes.x.gain={n // 2} seed={n % 2}"))
    sweep = overview_of(rows)
    assert (sweep.settings, sweep.seeds, sweep.constant) == (("nodes.x.gain",), True, ("variant=a",))
    for width in (80, 120):
        said = io.StringIO()
        Console(width=width, file=said).print(sweep_table(sweep, width))
        lines = said.getvalue().splitlines()
        assert max(map(len, lines)) <= width
        assert "0.050 (0 to 0.685)" in said.getvalue()
        assert sum(line.startswith("│") for line in lines) == 2
        assert "variant" not in said.getvalue()


def test_a_comparison_marks_the_best_and_shows_differing_settings():
    nodes = {"m": {"k": 1}}
    runs = [
        compared("runs/a", measured(), seed=0, nodes=nodes),
        compared("runs/b", measured(loss_rate=0.0, frames=10), seed=1, nodes=nodes),
    ]
    lines = printed(compare_table(runs)).splitlines()
    loss = next(line for line in lines if "Loss rate (%)" in line)
    assert "0 *" in loss
    assert "12.5 *" not in loss
    assert "*" not in next(line for line in lines if line.startswith("│ Frames"))
    assert any(line.strip("│ ").startswith("seed ") for line in lines)
    assert not any("m.k" in line for line in lines)
    assert not any("odometry alone" in line for line in lines)
    assert "different logs" not in lines[-1]
    other = compared("runs/c", measured(), log="other.mcap")
    assert "these are runs of different logs" in printed(compare_table([*runs, other]))


def test_where_more_is_better_the_largest_is_marked():
    described = {"goal.reached_rate": MetricSpec(better="higher"), "goal.end_error_m": MetricSpec(better="lower")}
    runs = [
        compared(f"runs/{share}", Metrics({"goal": {"reached_rate": share, "end_error_m": 2.0 - share}}, described))
        for share in (1.0, 0.0)
    ]
    lines = printed(compare_table(runs)).splitlines()
    for what, best in (("Reached rate", "100 *"), ("End error", "1.00 *")):
        assert best in next(line for line in lines if what in line)


def test_runs_with_long_names_stand_under_letters_that_are_explained():
    names = [f"runs/2026-01-0{day}_10-00-00_omniview_mcl" for day in (1, 2, 3)]
    said = printed(compare_table([compared(name, measured()) for name in names]))
    assert [said.count(name) for name in names] == [1, 1, 1]
    assert f"B: {names[1]}" in said


def test_settings_that_one_run_does_not_have_differ_too():
    assert differing_settings([{"a": 1, "b": {"c": 2, "d": 3}}, {"a": 1, "b": {"d": 3}}]) == [("b.c", ["2", "–"])]
    of_two = [
        {
            "nodes": {"match": {"_target_": f"stages.{cls}", **own}, "both": {"_target_": "stages.B", "own": own}},
            "wires": {"both": {"in": f"{cls}.out"}, **own},
        }
        for cls, own in (("L2", {}), ("Cosine", {"power": 2}))
    ]
    artifacts = [{"artifacts": {name: {"graph": graph} for name in ("map", "words")}} for graph in of_two]
    rows = [
        ("nodes.match", ["L2", "Cosine"]),
        ("nodes.both.own.power", ["–", "2"]),
        ("wires.both.in", ["L2.out", "Cosine.out"]),
    ]
    assert differing_settings(of_two) == rows
    assert differing_settings(artifacts) == [(f"artifacts.map.graph.{name}", values) for name, values in rows]


def test_control_characters_of_a_text_are_shown_and_never_sent():
    assert plain("a\x1b[2J\x00\x7f\x9f\tb\nÄ\xa0") == "a\\x1b[2J\\x00\\x7f\\x9f\tb\nÄ\xa0"
    console = Console(file=io.StringIO(), force_terminal=True, color_system="standard")
    console.print(PlainTexts(Text("evil\x9b2J", "bold")))
    console.print(PlainTexts(Control.home()), end="")  # what the program itself sends stays
    assert console.file.getvalue() == "\x1b[1mevil\\x9b2J\x1b[0m\n\x1b[H"

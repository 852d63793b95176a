import base64
import html
import io
import re
from html.parser import HTMLParser

import pytest
from rich.console import Console

from omninav.pipeline.graph.results import Figure, Table
from omninav.pipeline.report.quantities import digits, measures, shown, title, unit
from omninav.pipeline.report.report import (
    compare_table,
    differing_settings,
    results_table,
    write_report,
    write_sweep_page,
)

ERRORS = {"mean": 0.5, "median": 0.073, "p90": 0.81, "max": 12.34}
METRICS = {
    "frames": 300,
    "position_error_m": ERRORS,
    "loss_rate": 0.125,
    "converged_after_frames": 12,
    "after_convergence": {"position_error_m": {**ERRORS, "median": 0.05}, "loss_rate": 0.0},
    "odometry_alone": {"position_error_m": {**ERRORS, "median": 1.7}, "loss_rate": 0.5},
    "map": {"size_bytes": 168_000, "references": 200},
}
MANIFEST = {
    "status": "complete",
    "variant": "omniview_mcl",
    "argv": ["omninav", "variant=omniview_mcl", "log=my drive.mcap"],
    "started": "2026-01-01T10:00:00",
    "seed": 3,
    "dropped": {"source.duplicate_frame": {"count": 7, "first": "frame 12 <twice>"}},
    "facts": {"odometry": "synthetic", "map_poses": "truth"},
    "inputs": {"source": "ab" * 32},
    "libraries": {"numpy": "2.0"},
}
TIMING = {
    "ticks": 300,
    "ticks_per_second": 212.4,
    "stages": {"match": {"lifetime": "tick", "calls": 300, "p50_ms": 1.234, "p95_ms": 2.5, "max_ms": 31.0}},
}
SVG = '<svg xmlns="http://www.w3.org/2000/svg" width="10" height="10"><title>graph</title></svg>'
PICTURE = Figure("path", "The path", "Where it went & why.", b"\x89PNG not really", order=1)


class Wellformed(HTMLParser):
    """Raises where an element is closed that was not the last one opened."""

    VOID = frozenset({"meta", "img", "br", "rect", "path", "circle", "link"})

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []

    def handle_starttag(self, tag, attrs):
        if tag not in self.VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag


def report(tmp_path, metrics=METRICS, manifest=MANIFEST, figures=(PICTURE,), tables=()):
    manifest = {"cwd": str(tmp_path), **manifest}
    folder = tmp_path / "runs" / "a run"
    folder.mkdir(parents=True, exist_ok=True)
    path = write_report(folder, manifest, metrics, TIMING, SVG, figures, tables, "seed: 3\nname: <x>\n")
    return path.read_text()


def text_of(page: str) -> str:
    plain = re.sub(r"<style>.*?</style>", "", page, flags=re.S)
    return " ".join(html.unescape(re.sub(r"<[^>]*>", " ", plain)).split())


def test_a_page_refers_to_nothing_outside_itself(tmp_path):
    page = report(tmp_path)
    assert re.findall(r"https?://[^\"\s<]+", page.replace(SVG, "")) == []
    assert not re.search(r"<(?:link|script|iframe)\b|@import|url\(", page)
    assert set(re.findall(r'(?:src|href)="([^":]{4}):', page)) <= {"data"}


def test_a_page_is_well_formed_html(tmp_path):
    checker = Wellformed()
    checker.feed(report(tmp_path))
    assert checker.open == []


def test_results_stand_with_units_and_the_estimate_beside_odometry_alone(tmp_path):
    said = text_of(report(tmp_path))
    assert "Position error (m) all frames 0.500 0.073 0.810 12.3 after convergence 0.500 0.050" in said
    assert "odometry alone 0.500 1.70 0.810 12.3" in said
    assert "Loss rate (%) all frames 12.5" in said
    assert "Converged after 12 frames" in said
    assert "Map: size 168 kB" in said


def test_what_was_dropped_what_is_worth_knowing_and_how_to_run_it_again_are_said(tmp_path):
    said = text_of(report(tmp_path))
    assert "source.duplicate frame 7 frame 12 <twice>" in said
    assert "odometry synthetic" in said
    assert "omninav variant=omniview_mcl 'log=my drive.mcap'" in said
    assert "omninav resume 'runs/a run'" in said
    assert "match every tick 300 1.23 2.50 31.0" in said
    assert "212 frames per second" in said
    assert "name: <x>" in said


def test_pictures_are_inside_the_page_in_their_order(tmp_path):
    later = Figure("aaa", "Later", "Second.", b"<svg/>", media_type="image/svg+xml", order=2)
    page = report(tmp_path, figures=(later, PICTURE))
    assert f'src="data:image/png;base64,{base64.b64encode(PICTURE.content).decode()}"' in page
    assert page.index("The path") < page.index("Later")
    assert "Where it went &amp; why." in page
    assert SVG in page


def test_a_film_is_inside_the_page_and_can_be_stepped_through(tmp_path):
    film = Figure("film", "The drive", "Frame by frame.", b"not really a film", "video/mp4", per_second=8.0)
    page = report(tmp_path, figures=(PICTURE, film))
    assert 'src="data:video/mp4;base64,' in page
    assert 'data-per-second="8.0"' in page
    assert page.count("<script>") == 1
    assert "<script>" not in report(tmp_path, figures=(PICTURE,))
    picture = Figure("film", "The drive", "Moving.", b"GIF89a not really", "image/gif", per_second=8.0)
    assert "<script>" not in report(tmp_path, figures=(picture,))  # a browser plays it by itself


def test_tables_of_stages_are_shown(tmp_path):
    table = Table("places", "Places", "Where it has been.", ("place", "seen (s)"), (("hall", 1.234), ("<b>", None)))
    page = report(tmp_path, tables=(table,))
    assert "hall 1.23" in text_of(page)
    assert "&lt;b&gt;" in page


def test_a_run_without_truth_says_why_there_are_no_errors(tmp_path):
    assert "no ground truth" in text_of(report(tmp_path, metrics={"frames": 3}))


def test_a_drive_that_was_measured_is_not_said_to_lack_errors(tmp_path):
    metrics = {"frames": 300, "drive": {"collisions": 0, "distance_m": 22.1}}
    said = text_of(report(tmp_path, metrics=metrics))
    assert "collisions 0" in said
    assert "no measured errors" not in said


def test_a_filter_that_never_converged_is_said_to_have_never_done_so(tmp_path):
    metrics = {**METRICS, "converged_after_frames": None, "after_convergence": None}
    assert "Converged after never" in text_of(report(tmp_path, metrics=metrics))


def test_several_logs_have_a_line_each(tmp_path):
    said = text_of(report(tmp_path, metrics={**METRICS, "logs": [METRICS, {"frames": 7}]}))
    assert "Log by log" in said
    assert "1 7 – –" in said


def test_a_failed_job_stands_in_the_sweeps_page_with_its_error_and_log(tmp_path):
    good, bad = tmp_path / "0", tmp_path / "1"
    for folder, file in ((good, "report.html"), (bad, "run.log")):
        folder.mkdir()
        (folder / file).write_text("x")
    rows = [
        {"job": "0", "folder": good, "manifest": {"status": "complete", "overrides": "seed=0"}, "metrics": METRICS},
        {
            "job": "1",
            "folder": bad,
            "manifest": {"status": "failed", "overrides": "seed=1", "error": "stage 'x' failed: <no>"},
            "metrics": {},
        },
    ]
    page = write_sweep_page(tmp_path, rows).read_text()
    assert 'href="0/report.html"' in page
    assert 'href="1/run.log"' in page
    assert "stage &#39;x&#39; failed: &lt;no&gt;" in page
    assert "2 jobs: 1 complete, 1 failed" in page
    assert "0.050" in page
    assert "http" not in page


def test_a_sweeps_best_job_is_marked(tmp_path):
    worse = {**METRICS, "loss_rate": 0.5}
    rows = [
        {"job": str(n), "folder": tmp_path / str(n), "manifest": {"status": "complete"}, "metrics": m}
        for n, m in enumerate((worse, METRICS))
    ]
    page = write_sweep_page(tmp_path, rows).read_text()
    assert re.findall(r'<td class="best">([^<]*)</td>', page) == ["12.5"]


def printed(table) -> str:
    console = Console(width=140, record=True, file=io.StringIO())
    console.print(table)
    return console.export_text()


def test_the_terminals_table_has_units():
    said = printed(results_table(METRICS))
    for expected in ("Position error (m)", "0.073", "odometry alone", "Loss rate (%)", "12 frames", "168 kB"):
        assert expected in said
    assert "Frames" in printed(results_table({"frames": 3}))


def test_a_comparison_marks_the_best_and_shows_differing_settings():
    runs = [
        {"name": "runs/a", "metrics": METRICS, "config": {"seed": 0, "nodes": {"m": {"k": 1}}}, "manifest": {}},
        {
            "name": "runs/b",
            "metrics": {**METRICS, "loss_rate": 0.0, "frames": 10},
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


def test_of_shares_of_what_went_well_the_largest_is_best():
    reached = [{"navigation": {"reached_rate": share, "end_error_m": 2.0 - share}} for share in (1.0, 0.0)]
    runs = [{"name": f"runs/{n}", "metrics": m, "config": {}, "manifest": {}} for n, m in enumerate(reached)]
    lines = printed(compare_table(runs)).splitlines()
    for what, best in (("eached rate", "100 *"), ("nd error", "1.00 *")):
        assert best in next(line for line in lines if what in line)


def test_runs_with_long_names_stand_under_letters_that_are_explained():
    names = [f"runs/2026-01-0{day}_10-00-00_omniview_mcl" for day in (1, 2, 3)]
    said = printed(compare_table([{"name": n, "metrics": METRICS, "config": {}, "manifest": {}} for n in names]))
    assert [said.count(name) for name in names] == [1, 1, 1]
    assert f"B: {names[1]}" in said


def test_settings_that_one_run_does_not_have_differ_too():
    assert differing_settings([{"a": 1, "b": {"c": 2}}, {"a": 1}]) == [("b.c", ["2", "–"])]


@pytest.mark.parametrize(
    ("number", "text"),
    [(0.0731, "0.073"), (1.523, "1.52"), (12.34, "12.3"), (3500.2, "3500"), (0, "0"), (0.0, "0"), (0.00012, "1.2e-04")],
)
def test_numbers_have_the_digits_they_carry(number, text):
    assert digits(number) == text


def test_units_follow_from_the_ends_of_names():
    assert (title("position_error_m"), unit("position_error_m")) == ("Position error", "m")
    assert (title("heading_error_deg"), unit("heading_error_deg")) == ("Heading error", "°")
    assert (title("loss_rate"), unit("loss_rate"), shown("loss_rate", 0.015)) == ("Loss rate", "%", "1.50")
    assert (title("size_bytes"), unit("size_bytes"), shown("size_bytes", 1234)) == ("Size", "kB", "1.23")
    assert (title("frames"), unit("frames")) == ("Frames", "")


def test_every_number_has_its_path_and_a_readable_name():
    found = {measure.path: measure.name for measure in measures(METRICS)}
    assert found["after_convergence.position_error_m.median"] == "Position error, median, after convergence"
    assert found["map.references"] == "References, map"

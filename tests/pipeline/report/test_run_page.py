import base64
import html
import json
import re
from dataclasses import dataclass
from html.parser import HTMLParser
from types import SimpleNamespace
from typing import Annotated

import numpy as np
import pytest
from sample_metrics import VALUES, measured

from omninav.pipeline import Bounds, Context, Metrics, MetricSpec, Plot, Stage, Table
from omninav.pipeline.graph.results import Slide
from omninav.pipeline.graph.signature import signature
from omninav.pipeline.report.chart import Chart
from omninav.pipeline.report.run_page import parameter_rows, write_report

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
PICTURE = Plot("path", "The path", "Where it went & why.", b"\x89PNG not really", order=1)


class Wellformed(HTMLParser):
    """Raises where an element is closed that was not the last one opened."""

    VOID = frozenset({"meta", "img", "br", "rect", "path", "circle", "link", "input"})

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []

    def handle_starttag(self, tag, attrs):
        if tag not in self.VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag


def report(tmp_path, metrics=None, manifest=MANIFEST, plots=(PICTURE,), tables=(), graph=None):
    manifest = {"cwd": str(tmp_path), **manifest}
    folder = tmp_path / "runs" / "a run"
    folder.mkdir(parents=True, exist_ok=True)
    metrics, config = measured() if metrics is None else metrics, "seed: 3\nname: <x>\n"
    return write_report(folder, manifest, metrics, TIMING, SVG, plots, tables, config, graph).read_text()


def text_of(page: str) -> str:
    plain = re.sub(r"<(style|script).*?</\1>", "", page, flags=re.S)
    return " ".join(html.unescape(re.sub(r"<[^>]*>", " ", plain)).split())


def test_a_page_is_well_formed_html_and_refers_to_nothing_outside_itself(tmp_path):
    page, checker = report(tmp_path), Wellformed()
    checker.feed(page)
    assert checker.open == []
    assert re.findall(r"https?://[^\"\s<]+", page.replace(SVG, "")) == []
    assert not re.search(r"<(?:link|iframe|script src)\b|@import|url\(", page)
    assert set(re.findall(r'(?:src|href)="([^":#]*):', page)) == {"data"}


def test_a_page_has_results_with_units_skipped_data_notes_and_the_command(tmp_path):
    said = text_of(report(tmp_path))
    for words in (
        "Position error (m) all frames 0.500 0.073 0.810 12.3 after convergence 0.500 0.050",
        "odometry alone 0.500 1.70 0.810 12.3",
        "Loss rate (%) all frames 12.5",
        "Converged after 12 frames",
        "Map: size 168 kB",
        "source.duplicate frame 7 frame 12 <twice>",
        "Odometry synthetic",
        "omninav variant=omniview_mcl 'log=my drive.mcap'",
        "omninav resume 'runs/a run'",
        "match every tick 300 1.23 2.50 31.0",
        "212 frames per second",
        "libraries numpy 2.0",
        "name: <x>",
    ):
        assert words in said
    skipped = "duplicate frame, 7 times (first: frame 12 <twice>)"  # above the results
    assert said.index(skipped) < said.index("Position error")


def test_plots_are_inside_the_page_in_their_order(tmp_path):
    later = Plot("aaa", "Later", "Second.", b"<svg/>", media_type="image/svg+xml", order=2)
    page = report(tmp_path, plots=(later, PICTURE))
    assert f'src="data:image/png;base64,{base64.b64encode(PICTURE.content).decode()}"' in page
    assert page.index("The path") < page.index("Later")
    assert "Where it went &amp; why." in page
    assert SVG in page


def test_tables_of_stages_are_shown(tmp_path):
    table = Table("places", "Places", "Where it has been.", ("place", "seen (s)"), (("hall", 1.234), ("<b>", None)))
    page = report(tmp_path, tables=(table,))
    assert "hall 1.23" in text_of(page)
    assert "&lt;b&gt;" in page


GOAL = {"goal.reached": MetricSpec(title="Goal reached"), "goal.time_s": MetricSpec(title="Time to the goal")}


@pytest.mark.parametrize(
    ("metrics", "said"),
    [
        (measured(converged_after_frames=None, after_convergence=None), "Converged never"),
        (
            measured(logs=[VALUES, {"frames": 7}]),
            "Per log log Frames Position error, median, after convergence (m) Loss",
        ),
        (measured(logs=[VALUES, {"frames": 7}]), "Converged after (frames) 0 300 0.050 12.5 12 1 7 – – – "),
        (Metrics({"goal": {"time_s": 3.2, "reached": "yes"}}, GOAL, tuple(GOAL)), "yes Goal reached 3.20 s Time to"),
        (Metrics({}), "No stage of this graph measures anything"),
    ],
    ids=["never", "several logs", "a log without figures", "tiles of headlines in their order", "nothing"],
)
def test_what_a_page_says_of_figures(tmp_path, metrics: Metrics, said: str):
    assert said in text_of(report(tmp_path, metrics=metrics))


def chart() -> Chart:
    drawn = Chart((0.0, 2.0), (0.0, 1.0), "x (m)", "y (m)", equal=True)
    drawn.base.line(np.array([[0.0, 0.0], [1.0, 0.5], [np.nan, 0.0], [2.0, 1.0]]), "blue")
    return drawn


def test_a_chart_stands_in_the_page_in_the_colours_of_the_page(tmp_path):
    page = report(tmp_path, plots=(Plot("path", "The path", "It went.", chart().svg(), "image/svg+xml"),))
    assert 'style="fill:none;stroke-linejoin:round;stroke:var(--blue,#0072b2)' in page
    assert "prefers-color-scheme: dark" in page
    assert "--blue: #5fb4e6" in page


@pytest.mark.parametrize(
    ("kinds", "places"),
    [
        ("c", ["alone"]),
        ("cc", ["half", "half"]),
        ("ccc", ["half", "half", "alone"]),
        ("cpcc", ["alone", "", "half", "half"]),
        ("pcccp", ["", "half", "half", "alone", ""]),
    ],
)
def test_charts_that_follow_each_other_stand_in_pairs(tmp_path, kinds: str, places: list[str]):
    drawn = {"c": chart().svg(), "p": b"\x89PNG"}
    plots = [Plot(f"plot_{n}", "", "", drawn[kind], order=n) for n, kind in enumerate(kinds)]
    page = report(tmp_path, plots=plots)
    assert re.findall(r'<figure id="plot_\d"(?: class="([^"]*)")?>', page) == places


def test_slides_hold_each_photograph_once_and_cannot_end_their_script(tmp_path):
    frame = ("<circle/>", (("seen", b"JPEG"),), (("error", "1 m"),))
    slides = tuple(Slide(f"frame {n} </script>", *frame) for n in (0, 1))
    plot = Plot("frames", "Frames", "One by one.", chart().svg(), "image/svg+xml", slides=slides)
    page = report(tmp_path, plots=(plot,))
    data = json.loads(re.search(r'<script type="application/json">(.*?)</script>', page, flags=re.S)[1])
    assert data["photographs"] == [base64.b64encode(b"JPEG").decode()]
    assert [slide["photographs"] for slide in data["slides"]] == [[["seen", 0]]] * 2
    assert data["slides"][1]["label"] == "frame 1 </script>"
    assert data["slides"][0]["overlay"] == "<circle/>"


def test_ticks_in_which_a_stage_had_nothing_to_do_are_no_warning(tmp_path):
    manifest = MANIFEST | {"dropped": {"skipped.match": {"count": 9, "first": ""}}, "warnings": ["guessed speed"]}
    said = text_of(report(tmp_path, manifest=manifest))
    assert said.index("guessed speed") < said.index("Position error") < said.index("skipped.match 9")


class Idle(Stage):
    """Has parameters and does nothing."""

    def step(self, ctx: Context) -> None: ...


def graph_of(stage: type[Stage], **parameters: object) -> SimpleNamespace:
    """A graph of a stage with these parameters, the others as they are by default."""
    node = SimpleNamespace(name="smooth", signature=signature(stage), parameters=parameters)
    return SimpleNamespace(nodes={"smooth": node})


def test_parameters_stand_beside_their_defaults_with_what_they_mean(tmp_path):
    class Smoothed(Idle):
        window: Annotated[int, Bounds(ge=1)] = 5
        """Readings that are averaged."""
        robust: bool = False
        """Whether outliers are left out."""

    graph = graph_of(Smoothed, window=9)
    rows = parameter_rows(graph)
    assert [(row["name"], row["value"], row["default"], row["changed"]) for row in rows] == [
        ("window", "9", "5", True),
        ("robust", "False", "False", False),
    ]
    assert rows[0]["meaning"] == "Readings that are averaged."
    said = text_of(report(tmp_path, graph=graph))
    assert "Parameters (1 of 2 differs from the stage's own default)" in said
    changed, every = said.partition("Parameters (")[2].split("All 2")
    assert "nodes.smooth.window 9 5 Readings" in changed
    assert "robust" not in changed
    assert "nodes.smooth.robust False False" in every


def test_settings_that_belong_together_are_compared_one_by_one_and_long_values_to_their_ends():
    @dataclass(frozen=True)
    class Window:
        size: int = 5
        shape: str = "flat"

    class Smoothed(Idle):
        window: Window = Window()
        names: tuple[str, ...] = ("x" * 200, "a")

    def changed(**parameters: object) -> list[bool]:
        return [row["changed"] for row in parameter_rows(graph_of(Smoothed, **parameters))]

    assert changed(window={"size": 5, "shape": "flat"}, names=["x" * 200, "a"]) == [False, False]
    assert changed(window={"shape": "flat"}) == [False, False]
    assert changed(window={"size": 6}, names=["x" * 200, "b"]) == [True, True]


def test_a_figure_that_is_not_as_it_should_be_is_a_tile_in_another_colour(tmp_path):
    described = {"held": MetricSpec(title="95 % ellipse holds", unit="%", least=0.85)}
    for share, style in ((0.36, "tile off"), (0.95, "tile")):
        page = report(tmp_path, metrics=Metrics({"held": share}, described, ("held",)))
        assert f'<div class="{style}"><b>{100 * share:.1f} <small>%</small></b><span>95 % ellipse holds' in page


def test_what_files_name_is_text_on_the_page(tmp_path):
    evil = "<script>alert(1)</script><img src=x onerror=alert(2)>"
    manifest = MANIFEST | {
        "variant": evil,
        "argv": ["omninav", f"topics.image={evil}"],
        "dropped": {f"source.{evil}": {"count": 7, "first": evil}},
        "facts": {f"camera {evil}": evil},
        "warnings": [evil],
        "inputs": {evil: "ab" * 32},
        "libraries": {evil: evil},
        "error": evil,
    }
    page = report(tmp_path, manifest=manifest, plots=(Plot(evil, evil, evil, b"\x89PNG", order=1),))
    assert "alert(1)" in page
    assert "<script>alert" not in page
    assert "<img src=x" not in page

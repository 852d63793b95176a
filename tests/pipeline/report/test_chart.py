"""Figures in a chart: where marks, axes, ticks and the legend stand, in pixels."""

import re
import xml.etree.ElementTree as ET

import numpy as np
import pytest

from omninav.pipeline.report.chart import Chart, Layer, Scale, broken, stacked, steps

NAN = np.nan
HOLED = np.array([[0.0, 0.0], [1.0, 1.0], [NAN, 5.0], [3.0, 3.0], [4.0, 4.0]])
AROUND = np.array([[[3.25, 0.75 * 3**0.5], [0.75 * 3**0.5, 1.75]]])
"""Covariance of standard deviations 2 at 30 degrees from x and 1 across."""
CASES = [
    ("line", (HOLED, "blue"), "M0.0 100.0L10.0 90.0M30.0 70.0L40.0 60.0|stroke:var(--blue,#0072b2);stroke-width:1.5"),
    ("line", (HOLED[:2], "pink", 2.0, True, 0.5), ";stroke-width:2;stroke-dasharray:5 4;opacity:0.5"),
    ("dots", (HOLED[[1, 1, 2, 0]], "ink"), '"M0.0 100.0h0M10.0 90.0h0"|stroke-width:3.2'),
    ("discs", (HOLED, np.array([0.9, 1.0, 5, 0, 0]), "ink"), '<circle cx="10.0" cy="90.0" r="1.0"'),
    ("ring", (HOLED[1], "ink"), '<circle cx="10.0" cy="90.0" r="6" style="fill:none'),
    ("square", (HOLED[1], "ink"), '<rect x="6.0" y="86.0" width="8" height="8"'),
    ("crosses", (HOLED[1:3], "ink"), '"M6.0 86.0l8 8m0 -8l-8 8"|stroke-width:2"'),
    ("text", (HOLED[1], "<hall>"), '<text x="15.0" y="86.0" text-anchor="start">&lt;hall&gt;<'),
    ("dart", (np.array([1, 1, 0.0]), "ink", 10), '"22.5,90.0 2.0,84.0 5.5,90.0 2.0,96.0"'),
    ("dart", (np.array([1, 1, np.pi / 2]), "ink", 10), '"10.0,77.5 4.0,98.0 10.0,94.5 16.0,98.0"'),
    ("ellipses", (HOLED[1:2], AROUND, np.ones(1), "ink"), 'rx="40.0" ry="20.0" transform="translate(10.0 90.0)'),
    ("ellipses", (HOLED[1:2], AROUND * 0, np.ones(1), "ink"), 'rx="0.8" ry="0.8"|opacity:1;'),
    ("raster", (b"png", (1, 3, 2, 6)), 'x="10.0" y="40.0" width="20.0" height="40.0"'),
    ("upright", (3.0, "ink", "lost"), '"M30.0 100.0V0.0"|<text x="34.0" y="14.0" text-anchor="start">lost'),
    ("band", ((1.0, 1.1), "ink"), 'x="10.0" y="0.0" width="2.0"|height="100.0"'),
    ("band", ((1.0, 3.0), "ink"), 'x="10.0" y="0.0" width="20.0"'),
    ("level", (3.0, "ink"), '"M0.0 70.0H100.0"|stroke-dasharray:2 3'),
]
"""A mark, what it is drawn of, and parts of the drawing."""


@pytest.mark.parametrize(("kind", "given", "parts"), CASES)
def test_marks_stand_where_their_values_are(kind: str, given: tuple, parts: str):
    layer = Layer(Scale(0, 10, 0, 100), Scale(0, 10, 100, 0))
    getattr(layer, kind)(*given)
    assert [part for part in parts.split("|") if part not in layer.svg] == [], layer.svg
    if "40.0" in parts and kind == "ellipses":  # an axis has no direction
        assert int(re.search(r"rotate\((-?\d+)\)", layer.svg)[1]) % 180 == 150


def test_what_is_not_known_is_not_drawn():
    layer = Layer(Scale(0, 10, 0, 100), Scale(0, 10, 100, 0))
    layer.dart(np.array([1.0, 1.0, NAN]), "ink")
    layer.ring(HOLED[2], "ink")
    layer.square(HOLED[2], "ink")
    layer.ellipses(HOLED[2:3], AROUND, np.ones(1), "ink")
    assert layer.svg == ""


@pytest.mark.parametrize(
    ("low", "high", "pixels", "log", "expected"),
    [
        (0.0, 2.0, 484, False, [0, 0.5, 1, 1.5, 2]),
        (-1.0, 1.0, 190, False, [-1, 0, 1]),
        (0.3, 10.0, 140, False, [5, 10]),
        (0.0, 1.0, 30, False, [0, 0.5, 1]),
        (1.0, 100.0, 190, True, [1, 2, 5, 10, 20, 50, 100]),
        (0.02, 30.0, 190, True, [0.1, 1, 10]),
    ],
)
def test_ticks_are_round_values_inside_the_axis(low, high, pixels, log, expected):
    found = Scale(low, high, pixels, 0, log).ticks()
    assert (found, "-0.0" in map(str, found)) == (expected, False)


def test_values_become_pixels_and_a_logarithm_has_none_below_0():
    assert Scale(1, 100, 200, 0, log=True)([1, 10, 100, 0, -1]) == pytest.approx([200, 100, 0, NAN, NAN], nan_ok=True)
    assert (Scale(2, 4, 64, 264)([2, 3, 4]).tolist(), Scale(2, 4, 264, 64).per_unit) == ([64, 164, 264], 100)
    assert broken(HOLED[:2], [1]).tolist() == [[0, 0], [pytest.approx(NAN, nan_ok=True)] * 2, [1, 1]]
    assert steps([0, 2, 5], [7, 8]).tolist() == [[0, 7], [2, 7], [2, 8], [5, 8]]


def texts(svg: bytes) -> list[tuple[float, float, str, str]]:
    """Words in a chart: x, y, anchor, text."""
    found = ET.fromstring(svg.decode()).iter("{http://www.w3.org/2000/svg}text")
    return [(float(t.get("x")), float(t.get("y")), t.get("text-anchor"), t.text) for t in found]


def test_axes_have_their_labels_ticks_and_grid_and_a_legend_of_as_many_rows_as_it_needs():
    chart = Chart((0.0, 1.0), (0.0, 10.0), "time (s)", "error (m)")
    bare = chart.svg()
    assert texts(bare) == [
        *[(round(64 + 484 * at, 1), 238, "middle", f"{at:g}") for at in (0, 0.2, 0.4, 0.6, 0.8, 1)],
        *[(58, 220 + 4 - 19 * at, "end", f"{at}") for at in (0, 5, 10)],
        (306, 260, "middle", "time (s)"),
        (8, 18, "start", "error (m)"),
    ]
    grid = re.findall(r'd="([^"]*)" class="grid"', bare.decode())
    assert (grid[0], grid[5], grid[7]) == ("M64.0 30.0V220.0", "M548.0 30.0V220.0", "M64.0 125.0H548.0")
    assert b'd="M64.0 30.0V220.0H548.0" class="axis"' in bare
    assert b'<svg x="64" y="30" width="484" height="190" viewBox="64 30 484 190">' in bare
    for letters, symbol in ((5, "dot"), (5, "ring"), (5, "square"), (24, "dashes"), (1, "line")):
        for _ in range(2):
            chart.name(letters * symbol[0], "blue", symbol)
    legend = chart.svg().decode()
    places = [(64, 284.6), (154.5, 284.6), (245, 284.6), (64, 308.6), (331.2, 308.6)]
    assert [text[:2] for text in texts(legend.encode())[-5:]] == places
    for part in (
        '<circle cx="49.0" cy="279.6" r="3" style="fill:var(--blue,#0072b2)"/>',
        '<circle cx="139.5" cy="279.6" r="5" style="fill:none;stroke:var(--blue,#0072b2);stroke-width:2"/>',
        '<rect x="225.0" y="274.6" width="10" height="10" style="fill:var(--blue,#0072b2)"/>',
        '<path d="M36.0 303.6h24" style="fill:none;stroke:var(--blue,#0072b2);stroke-width:2;stroke-dasharray:5 4"/>',
        '<path d="M303.2 303.6h24" style="fill:none;stroke:var(--blue,#0072b2);stroke-width:2"/>',
    ):
        assert part in legend
    both = stacked([chart, chart]).decode()
    heights = [re.search(r'viewBox="0 0 560 (\d+)"', each)[1] for each in (bare.decode(), legend, both)]
    assert (heights, re.findall(r"translate\(0 (\d+)\)", both)) == (["270", "318", "636"], ["0", "318"])
    chart.unnamed()
    assert chart.svg() == bare


@pytest.mark.parametrize(
    ("x", "y", "tall", "shown"),
    [
        ((0, 484), (0, 242), 242, (0, 484, 0, 242)),
        ((0, 484), (0, 100), 190, (0, 484, -45, 145)),
        ((0, 100), (-100, 900), 520, (50 - 242 / 0.52, 50 + 242 / 0.52, -100, 900)),
    ],
)
def test_a_unit_of_an_equal_chart_is_as_long_upwards_as_across(x, y, tall, shown):
    chart = Chart(x, y, "x (m)", "y (m)", equal=True)
    assert (chart.tall, chart.x.per_unit) == pytest.approx((tall, chart.y.per_unit))
    assert (chart.x.low, chart.x.high, chart.y.low, chart.y.high) == pytest.approx(shown)

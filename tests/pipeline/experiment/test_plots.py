"""Plots on an experiment's page."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import cv2
import numpy as np
import pytest
from made_experiments import experiment, run_with

from omninav.pipeline.experiment import plots
from omninav.pipeline.experiment.plots import plots_of
from omninav.pipeline.experiment.result import ExperimentResult, summary_of
from omninav.pipeline.experiment.verdicts import key_of
from omninav.pipeline.report.plot_style import plot

LONG = "Error of the direction up to 6 m away, median, not found is 180 (degrees)"

LOOKS = [("o", "#0072B2"), ("s", "#D55E00")]
"""Marker and colour of the first curves of a plot."""


def drawn(methods: int, levels: tuple[float, ...] = (1.0,), **page: object) -> list[np.ndarray]:
    """Images (colour, BGR) of the plots of an experiment with long names; method n's curve lies at levels[n].

    The error of the n-th condition is 10 n², and 1 more or less in each of two runs.
    """
    names = {f"a method with the long name number {n}": f"x={n}" for n in range(methods)}
    plotted = experiment(
        sweep={"method": names, "side": {"1": "y=1", "2": "y=2"}},
        measures={"error": {"title": LONG, "path": ["error"]}},
        curves=[{"title": LONG, "x_label": "step", "path": "along", "panels": "side", "reference": {"odo": "odo"}}],
        published={"error": {next(iter(names)): {"2": 12.0}}},
        page={"rows": ["method"], "columns": "side", **page},
    )
    results = {}
    for number, condition in enumerate(plotted.conditions(), 1):
        level = levels[int(condition.labels["method"][-1]) % len(levels)]
        results[key_of(condition.labels)] = {
            (f"world {d}", 0): run_with(error=10.0 * number**2 + d, along=3 * [level * (1 + d / 2)], odo=[7.0] * 3)
            for d in (-1, 1)
        }
    result = ExperimentResult("test", "", "full", "", "", *summary_of(plotted, results, {}))
    return [cv2.imdecode(np.frombuffer(p.content, np.uint8), cv2.IMREAD_COLOR) for p in plots_of(plotted, result)]


@pytest.mark.parametrize("page", [{}, {"along": "side"}], ids=["bars", "lines"])
def test_titles_and_legends_are_drawn_whole(page: dict[str, object]) -> None:
    for image in drawn(5, **page):
        border = np.concatenate([image[:2].ravel(), image[-2:].ravel(), image[:, :2].ravel(), image[:, -2:].ravel()])
        assert border.min() > 200


def test_a_tall_legend_takes_no_room_from_the_plot() -> None:
    assert drawn(9)[-1].shape[0] > drawn(1)[-1].shape[0]


@pytest.fixture
def canvases(monkeypatch: pytest.MonkeyPatch) -> list[Any]:
    """Canvases of the plots that are drawn, with the sizes that they were begun with."""
    found: list[Any] = []

    @contextmanager
    def kept(*size: float) -> Iterator[Any]:
        with plot(*size) as drawn:
            yield drawn
            found.append((drawn.canvas, size))

    monkeypatch.setattr(plots, "plot", kept)
    return found


def points(axes: Any) -> list[Any]:
    return [line.get_xydata().tolist() for line in axes.lines if len(line.get_xydata())]


def test_bars_stand_side_by_side_with_the_paper_s_figures_on_them(canvases: list[Any]) -> None:
    drawn(2)
    (axes,), size = canvases[0][0].axes, canvases[0][1]
    bars = [(bar.get_x(), bar.get_width(), bar.get_height()) for bar in axes.patches]
    assert np.allclose(bars, [(-0.38, 0.36, 10.0), (0.62, 0.36, 40.0), (0.02, 0.36, 90.0), (1.02, 0.36, 160.0)])
    assert [[end[1] for end in bar] for bar in axes.collections[0].get_segments()] == [[9.0, 11.0], [39.0, 41.0]]
    assert [[0.8, 12.0]] in [np.round(each, 9).tolist() for each in points(axes)]
    assert (axes.get_ylim()[0], size) == (0.0, (pytest.approx(1.1 + 2 * 1.95), 3.6))


def test_lines_lie_along_a_factor(canvases: list[Any]) -> None:
    drawn(2, along="side")
    (axes,) = canvases[0][0].axes
    assert [each.lines[0].get_xydata().tolist() for each in axes.containers] == [
        [[1.0, 10.0], [2.0, 40.0]],
        [[1.0, 90.0], [2.0, 160.0]],
    ]
    assert [(each.lines[0].get_marker(), each.lines[0].get_color()) for each in axes.containers] == LOOKS
    assert [[end[1] for end in bar] for bar in axes.collections[0].get_segments()] == [[9.0, 11.0], [39.0, 41.0]]


def test_of_many_rows_each_has_its_points_and_far_figures_are_in_powers_of_ten(canvases: list[Any]) -> None:
    drawn(9)
    (axes,), size = canvases[0][0].axes, canvases[0][1]
    found = [each.lines[0].get_xydata()[[0, 8]].tolist() for each in axes.containers]
    assert np.allclose(found, [[[10.0, 0.05], [2890.0, -7.95]], [[40.0, -0.05], [3240.0, -8.05]]])
    assert [(each.lines[0].get_marker(), each.lines[0].get_color()) for each in axes.containers] == LOOKS
    assert (axes.get_xlim()[0], axes.get_xscale(), size) == (5.0, "log", (8.0, pytest.approx(1.3 + 0.28 * 9)))


@pytest.mark.parametrize(
    ("levels", "scale"),
    [((1.0, 10.0), ("linear", 0.0)), ((1.0, 11.0), ("log", 0.5)), ((0.0, 2.0, 21.0), ("symlog", -0.4))],
)
def test_a_curve_is_the_mean_in_a_band_and_what_it_is_compared_to_is_dashed(
    canvases: list[Any], levels: tuple[float, ...], scale: tuple[str, float]
) -> None:
    drawn(len(levels), levels)
    canvas, size = canvases[1]
    assert [axes.get_title("left") for axes in canvas.axes] == ["1", "2"]
    for axes in canvas.axes:
        assert points(axes) == [[[n, level] for n in (1.0, 2.0, 3.0)] for level in (*levels, 7.0)]
        assert [line.get_linestyle() for line in axes.lines] == ["-"] * len(levels) + ["--"]
        band = axes.collections[-1].get_paths()[0].vertices
        assert (band[:, 1].min(), band[:, 1].max()) == (levels[-1] / 2, levels[-1] * 1.5)
    assert (canvas.axes[0].get_yscale(), canvas.axes[0].get_ylim()[0], size) == (*scale, (9.6, 3.8))

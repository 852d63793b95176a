"""Plots on an experiment's page."""

import cv2
import numpy as np
import pytest
from made_experiments import experiment, run_with

from omninav.pipeline.experiment.plots import plots_of
from omninav.pipeline.experiment.result import ExperimentResult, figures_of
from omninav.pipeline.experiment.verdicts import key_of
from omninav.pipeline.report.plot_style import PALETTE

LONG = "Error of the direction up to 6 m away, median, not found is 180 (degrees)"


def drawn(methods: int, along: tuple[float, ...] = (1.0,), **page: object) -> list[np.ndarray]:
    """Images (colour, BGR) of the plots of an experiment with long names; method n's curve lies at along[n]."""
    names = {f"a method with the long name number {n}": f"x={n}" for n in range(methods)}
    plotted = experiment(
        sweep={"method": names, "side": {"1": "y=1", "2": "y=2"}},
        measures={"error": {"title": LONG, "path": ["error"]}},
        curves=[{"title": LONG, "x_label": "step", "path": "along"}],
        page={"rows": ["method"], "columns": "side", **page},
    )
    results = {}
    for condition in plotted.conditions():
        level = along[int(condition.labels["method"][-1]) % len(along)]
        run = run_with(error=2.0, along=3 * [level])
        results[key_of(condition.labels)] = {("world 1", 0): run, ("world 2", 0): run}
    result = ExperimentResult("test", "", "full", "", "", *figures_of(plotted, results, {}))
    return [cv2.imdecode(np.frombuffer(p.content, np.uint8), cv2.IMREAD_COLOR) for p in plots_of(plotted, result)]


@pytest.mark.parametrize("page", [{}, {"along": "side"}], ids=["bars", "lines"])
def test_titles_and_legends_are_drawn_whole(page: dict[str, object]) -> None:
    for image in drawn(5, **page):
        border = np.concatenate([image[:2].ravel(), image[-2:].ravel(), image[:, :2].ravel(), image[:, -2:].ravel()])
        assert border.min() > 200


def test_a_tall_legend_takes_no_room_from_the_plot() -> None:
    assert drawn(5)[-1].shape[0] > drawn(1)[-1].shape[0]


def test_a_line_at_zero_is_drawn_beside_one_that_is_a_hundred_times_another() -> None:
    curve = drawn(3, along=(0.0, 1.0, 100.0))[-1]
    colour = [int(PALETTE[1][n : n + 2], 16) for n in (5, 3, 1)]
    of_the_line = np.abs(curve.astype(int) - colour).max(axis=2) < 8
    assert of_the_line.any(axis=0).sum() > curve.shape[1] / 2

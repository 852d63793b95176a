"""Lines of long runs are drawn in few points."""

import numpy as np
import pytest

from omninav.pipeline.report.chart import STRETCHES, drawn_points


def test_a_short_line_loses_what_no_eye_tells_apart():
    line = np.array([[0.0, 0.0], [0.1, 0.0], [0.1, 0.1], [9.0, 0.0], [9.05, 0.0]])
    assert drawn_points(line).tolist() == [[0.0, 0.0], [9.0, 0.0], [9.05, 0.0]]


def test_a_line_that_comes_back_is_drawn_all_the_way():
    line = np.array([[0.0, 0.0], [9.0, 0.0], [0.0, 0.0], [0.0, 0.0], [9.0, 0.0]])
    assert drawn_points(line).tolist() == line[[0, 1, 2, 4]].tolist()
    for few in (line[:0], line[:1], line[2:4]):
        assert drawn_points(few).tolist() == few.tolist()


def test_of_a_stretch_its_ends_its_peaks_and_its_first_gap_are_kept_where_a_line_is_too_long():
    zigzag = np.column_stack([np.arange(8.0 * STRETCHES), np.tile([0.0, 9.0], 4 * STRETCHES)])
    assert len(drawn_points(zigzag[: 4 * STRETCHES])) == 4 * STRETCHES
    kept = [8 * stretch + place for stretch in range(STRETCHES) for place in (0, 1, 7)]
    assert drawn_points(zigzag)[:, 0].tolist() == kept
    zigzag[2::2][np.arange(4 * STRETCHES - 1) % 4 < 3] = np.nan  # of each stretch the places 2, 4 and 6
    assert drawn_points(zigzag)[:, 1].tolist() == pytest.approx([0.0, 9.0, np.nan, 9.0] * STRETCHES, nan_ok=True)


def test_a_long_line_keeps_its_ends_its_peaks_and_its_gaps():
    rng = np.random.default_rng(0)
    line = np.column_stack([np.linspace(0, 700, 200_000), rng.uniform(0, 100, 200_000)])
    line[70_000, 1], line[140_001, 1] = 500.0, -500.0
    line[100_000:110_000] = np.nan
    drawn = drawn_points(line)
    assert drawn[[0, -1]].tolist() == line[[0, -1]].tolist()
    assert np.nanmax(drawn[:, 1]) == 500.0
    assert np.nanmin(drawn[:, 1]) == -500.0
    sparse = np.flatnonzero(np.diff(drawn[np.isfinite(drawn[:, 0]), 0]) > 2.0)
    assert len(sparse) == 1  # the gap alone


def test_a_line_of_nothing_but_gaps_stays_one():
    assert np.isnan(drawn_points(np.full((10_000, 2), np.nan))).all()

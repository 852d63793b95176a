"""Figures on an experiment's page."""

import pytest

from omninav.pipeline.experiment.page import number


@pytest.mark.parametrize(
    ("value", "text"),
    [(12.34, "12.3"), (0.0, "0.0"), (0.0227, "0.02"), (-0.004, "-0.004"), (None, "–"), (float("nan"), "–")],
)
def test_a_figure_has_its_digits_and_looks_like_nought_only_where_it_is(value: float | None, text: str) -> None:
    assert number(value, 1) == text

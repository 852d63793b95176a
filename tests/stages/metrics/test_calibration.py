"""Stated probabilities and ellipses against what came true."""

import re

import numpy as np
import pytest
from measured_drives import AT_ORIGIN, Row, figures, made_drive
from scipy.stats import mannwhitneyu

from omninav.pipeline import Context
from omninav.pipeline.report.headlines import headline_rows
from omninav.stages.geometry.probability.reliability import (
    area_under_roc,
    expected_calibration_error,
    reliability,
    squared_mahalanobis,
)
from omninav.stages.metrics.calibration import Calibration
from omninav.stages.monitor.consistency import log_odds_of_right
from omninav.stages.plots.confidence_over_time import ConfidenceOverTime
from omninav.stages.plots.reliability_diagram import ReliabilityDiagram
from omninav.stages.values.belief import PoseEstimate
from omninav.stages.values.confidence import PoseConfidence
from omninav.stages.values.drive import Drive
from omninav.stages.values.pose import Pose
from omninav.stages.values.stretches import Stretch, Stretches


def test_statements_that_come_true_as_often_as_stated_have_no_calibration_error():
    true = np.repeat([True, False, True, False], [8, 2, 1, 9])
    assert expected_calibration_error(reliability(np.repeat([0.8, 0.1], 10), true)) == pytest.approx(0.0)
    # worked by hand: 10 of 20 statements are 0.2 too high, the others 0.1 too low
    assert expected_calibration_error(reliability(np.repeat([1.0, 0.0], 10), true)) == pytest.approx(0.15)


def test_area_under_roc_is_the_statistic_of_mann_and_whitney():
    rng = np.random.default_rng(0)
    scores, positive = rng.integers(0, 8, 60).astype(float), rng.random(60) < 0.3
    peer = mannwhitneyu(scores[positive], scores[~positive]).statistic / (positive.sum() * (~positive).sum())
    assert area_under_roc(scores, positive) == pytest.approx(peer)
    assert area_under_roc(scores, np.zeros(60, bool)) is None


def odds(consistent: list[float], kidnapping: float = 0.0) -> float:
    ones = np.ones(len(consistent))
    agreeing = np.array(consistent, float)
    return log_odds_of_right(agreeing, ones - agreeing, ones, 0.05, 20.0, kidnapping)


def test_the_odds_after_no_image_are_even_and_agreement_speaks_for_the_estimate():
    assert odds([]) == pytest.approx(0.0)
    # one image: the mean of a uniform share against chance
    assert odds([1]) == pytest.approx(np.log(0.5 / 0.05))
    assert odds([0]) == pytest.approx(np.log(0.5 / 0.95))


def test_a_change_that_may_happen_lets_the_last_images_decide():
    # two images, worked by hand: right and right, wrong then right, against wrong and wrong, right then wrong
    right, wrong = 1 / 3 + 0.1 * 0.05 / 2, 0.05 * 2 / 21 + 0.1 * 0.05 / 2
    assert odds([1, 1], kidnapping=0.1) == pytest.approx(np.log(right / wrong))


def made(confidences: list[float | None], sigma: float = 0.3) -> Drive:
    """Errors drawn from the stated covariance; the last quarter is 5 m off as well."""
    rng, number = np.random.default_rng(3), len(confidences)
    x = rng.normal(0.0, 0.3, (number, 2)) + np.where(np.arange(number) >= 0.75 * number, 5.0, 0.0)[:, None]
    covariance = np.diag([sigma**2, sigma**2, 0.01])
    estimates = [PoseEstimate(Pose(a, b, 0.0), covariance, 1.0, Pose(a, b, 0.0)) for a, b in x.tolist()]
    told = [None if each is None else PoseConfidence(each) for each in confidences]
    return made_drive([AT_ORIGIN] * number, estimates=estimates, confidences=told)


def measured(drive: Drive, **parameters: float) -> dict:
    return figures(Calibration(**parameters), drive)["calibration"]


def test_a_confidence_that_falls_where_the_robot_is_lost_tells_all_of_it():
    out = Calibration().step(Context("calibration"), made([0.9] * 300 + [0.1] * 100))
    assert out.metrics.values["calibration"]["lost_auroc"] == 1.0
    drawn = ReliabilityDiagram().step(Context("plot"), out.reliability).plot
    assert drawn is not None
    assert b"confidence" in drawn.content
    assert "0.5 m and 10°" in drawn.caption


def test_without_a_confidence_only_ellipses_are_told():
    out = Calibration().step(Context("calibration"), made([None] * 40))
    assert out.metrics.values["calibration"].keys() == {"ellipse_50", "ellipse_95", "nees"}
    assert out.reliability is None
    assert ReliabilityDiagram().step(Context("plot"), out.reliability).plot is None


def test_squared_errors_are_over_covariances_and_a_flat_covariance_has_none():
    # The inverse of ((2, 1), (1, 2)) is ((2, -1), (-1, 2)) / 3: of (1, 1) that is 2 / 3, of (1, -2) 14 / 3.
    covariance = np.array([[2.0, 1.0], [1.0, 2.0]])
    errors = np.array([[1.0, 1.0], [1.0, -2.0]])
    assert squared_mahalanobis(errors, np.stack([covariance] * 2)) == pytest.approx([2 / 3, 14 / 3])
    assert np.isnan(squared_mahalanobis(np.ones((1, 2)), np.zeros((1, 2, 2)))).all()


def test_confidence_is_plotted_where_there_is_one():
    figure = ConfidenceOverTime().step(Context("plot"), made([0.9, 0.2, 0.3, 0.1])).plot
    assert figure is not None
    assert "75 %" in figure.caption
    once = {"start_s": 0.0, "end_s": 0.1, "metres": 0.0, "cause": "a cause", "evidence": "numbers", "advice": ""}
    found = (Stretch(0, 0, 0, state="searching", **once), Stretch(0, 1, 3, state="unsure", **once))
    banded = ConfidenceOverTime().step(Context("plot"), made([0.9, 0.2, 0.3, 0.1]), Stretches(found)).plot
    assert banded is not None
    assert banded.caption.endswith(" Image 0, a cause: numbers. Images 1 to 3, a cause: numbers.")
    assert re.findall("<path[^>]*--blue", banded.content.decode()) == []  # a band has this colour, the curve another
    assert banded.content.count(b">confidence</text>") == 2  # the axis and the legend
    assert ConfidenceOverTime().step(Context("plot"), made([None] * 4)).plot is None


TRUE = (3.0, -2.0, 1.0)


def beside(offsets: list[tuple[float, float, float]], confidences: list[float], truth: list[Row] | None = None) -> dict:
    """Measures estimates that lie so far (m, m, degrees) from the true pose."""
    believed = np.array(offsets) * (1.0, 1.0, np.pi / 180) + TRUE
    told = [PoseConfidence(each) for each in confidences]
    return measured(made_drive(truth or [TRUE] * len(offsets), believed, confidences=told))


def test_a_frame_is_right_within_both_tolerances_and_lost_beyond_its_own():
    offsets = [(0.5, 0, 0), (0.6, 0, 0), (0, 0, 10.1), (0, 2.5, 0), (0, 3.0, 0), (0, 0, -9.9), (9.0, 9.0, 0)]
    found = beside(offsets, [0.9, 0.4, 0.6, 0.5, 0.2, 0.55, 0.3], [TRUE] * 6 + [None])
    assert found["right_share"] == pytest.approx(2 / 6)
    assert found["wrong_auroc"] == pytest.approx(7 / 8)  # 0.6 of a wrong frame is above 0.55 of a right one
    assert found["lost_auroc"] == 1.0


def test_an_ellipse_ends_where_chi_squared_of_two_degrees_says():
    found = beside([(1.17, 0, 0), (0, 1.185, 0), (2.44, 0, 0), (0, -2.455, 0)], [0.5] * 4)
    assert (found["ellipse_50"], found["ellipse_95"]) == (0.25, 0.75)
    assert found["nees"] == pytest.approx(np.mean([1.17**2, 1.185**2, 2.44**2, 2.455**2]))


def test_an_estimate_at_both_tolerances_is_right() -> None:
    drive = made_drive([AT_ORIGIN] * 2, [(0.5, 0.0, np.pi / 2), (0.5, 0.0, 1.6)], confidences=[PoseConfidence(0.5)] * 2)
    assert measured(drive, within_deg=90.0)["right_share"] == 0.5


@pytest.mark.parametrize(("sigma", "first"), [(0.3, ()), (0.1, ("calibration.ellipse_95",))])
def test_ellipses_are_among_the_headlines_where_they_are_too_small(sigma, first):
    drive = made([0.9] * 400, sigma)
    metrics = Calibration().step(Context("c"), drive.at(np.arange(400) < 300)).metrics
    assert metrics.headlines == (*first, "calibration.expected_error")
    shown = {row.name: row for row in headline_rows(metrics, {})}
    assert all(shown["95 % ellipse holds"].off for _ in first)
    assert metrics.specs["calibration.right_share"].title == "Frames within 0.5 m and 10°"

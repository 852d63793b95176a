import numpy as np
import pytest

from omninav.stages.metrics.loop_closures import average_precision, precision_recall


def test_average_precision_is_one_where_all_right_hypotheses_have_more_support_than_the_wrong_ones():
    assert average_precision(np.array([0.9, 0.2, 0.8]), np.array([True, False, True])) == 1.0


def test_average_precision_worked_by_hand():
    # accepted by falling support: right, wrong, right, wrong: (1/1 + 2/3) / 2
    found = average_precision(np.array([0.9, 0.7, 0.5, 0.1]), np.array([True, False, True, False]))
    assert found == pytest.approx((1.0 + 2.0 / 3.0) / 2.0)


def test_hypotheses_of_equal_support_are_accepted_together_whatever_their_order():
    support = np.array([0.5, 0.5])
    assert average_precision(support, np.array([True, False])) == average_precision(support, np.array([False, True]))


def test_without_a_right_hypothesis_there_is_no_average_precision():
    assert average_precision(np.array([0.5]), np.array([False])) is None


def test_precision_and_recall_worked_by_hand():
    precision, recall = precision_recall(np.array([0.9, 0.7, 0.7, 0.1]), np.array([True, False, True, False]))
    assert precision == pytest.approx([1.0, 2 / 3, 2 / 4])
    assert recall == pytest.approx([0.5, 1.0, 1.0])

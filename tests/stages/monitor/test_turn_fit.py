import numpy as np
import pytest

from omninav.stages.monitor.turn_fit import MAX_TURN, explained, turn_fit

TIMES = np.arange(80) * 0.5


def headings(times):
    """A robot that turns left and right, each turn some seconds long."""
    return 2.0 * np.sin(times / 3.0) + np.sin(times / 1.7)


SEEN = np.diff(headings(TIMES))


def test_equal_turns_are_explained_and_no_turns_explain_nothing():
    assert explained(SEEN, SEEN) == 1.0
    assert explained(SEEN, np.zeros_like(SEEN)) == 0.0
    assert explained(SEEN, -SEEN) == pytest.approx(-1.0)


def test_one_wrong_turn_counts_no_more_than_the_limit():
    seen = np.array((0.5, 0.5, 3.0))
    assert explained(seen, np.array((0.5, 0.5, 0.0))) == pytest.approx(1.0 - MAX_TURN / (1.0 + MAX_TURN))


def test_turns_as_they_are_and_reversed():
    as_is, reversed = turn_fit(TIMES, headings(TIMES), SEEN), turn_fit(TIMES, -headings(TIMES), SEEN)
    assert (as_is.sign, as_is.delay_s, as_is.as_is) == (1, 0.0, pytest.approx(1.0))
    assert (reversed.sign, reversed.delay_s, reversed.explained) == (-1, 0.0, pytest.approx(1.0))


@pytest.mark.parametrize("delay", [-3.0, -0.5, 0.5, 3.0])
def test_a_delay_is_found_to_half_the_time_between_images(delay):
    seen = np.diff(headings(TIMES - delay))  # what was at t - delay is stamped t
    fit = turn_fit(TIMES, headings(TIMES), seen)
    assert fit.sign == 1
    assert fit.delay_s == pytest.approx(delay, abs=0.25)
    assert fit.explained > fit.as_is + 0.1


def test_images_that_saw_no_turn_do_not_count():
    seen = SEEN.copy()
    seen[::3] = np.nan
    assert turn_fit(TIMES, headings(TIMES), seen).as_is == pytest.approx(1.0)

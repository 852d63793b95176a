"""Random generators by purpose."""

import numpy as np

from omninav.stages.simulator.streams import stream


def test_the_same_purpose_gives_the_same_numbers_and_another_gives_others():
    purposes = [(1, "goods", 3), (1, "goods", 4), (1, "line", 3), (2, "goods", 3), (1, "goods")]
    draws = [stream(*purpose).uniform(size=4).tolist() for purpose in purposes]
    assert draws == [stream(*purpose).uniform(size=4).tolist() for purpose in purposes]
    assert len({tuple(numbers) for numbers in draws}) == len(purposes)


def test_what_one_purpose_draws_changes_nothing_for_another():
    before = stream(1, "noise").normal(size=3)
    stream(1, "goods").normal(size=100)
    np.testing.assert_array_equal(stream(1, "noise").normal(size=3), before)

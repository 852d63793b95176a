"""Plain matching: the pose of the most similar reference, turned as it looks most similar."""

import math

import numpy as np
import pytest
from made_references import references

from omninav.pipeline import Context
from omninav.stages.fusion.best_match import BestMatch
from omninav.stages.values.similarity import Similarities

MAP = references([[1.0, 2.0, 0.5], [3.0, 4.0, 3.0], [5.0, 6.0, -2.0]])


def best(values: list[list[float]], candidates: list[int] | None = None) -> tuple[float, float, float] | None:
    chosen = None if candidates is None else np.array(candidates, np.int64)
    alike = Similarities(np.array(values, np.float32).reshape(len(values), 4), chosen)
    belief = BestMatch().step(Context("fusion"), alike, MAP).belief
    return None if belief is None else (belief.pose.x, belief.pose.y, belief.pose.heading)


def test_the_pose_is_that_of_the_most_similar_reference_turned_by_its_heading() -> None:
    # Of four headings the second is a quarter turn counter-clockwise: 3 + pi/2, which is beyond half a turn.
    found = best([[0.1, 0.2, 0.0, 0.0], [0.0, 0.9, 0.3, 0.0], [0.8, 0.0, 0.0, 0.0]])
    assert found == pytest.approx((3.0, 4.0, 3.0 + math.pi / 2 - 2 * math.pi))


def test_of_some_references_only_each_row_is_that_of_its_own() -> None:
    assert best([[0.0, 0.0, 0.0, 0.4], [0.0, 0.0, 0.3, 0.0]], [0, 2]) == pytest.approx(
        (1.0, 2.0, 0.5 + 1.5 * math.pi - 2 * math.pi)
    )
    assert best([[0.1, 0.0, 0.0, 0.0], [0.0, 0.0, 0.3, 0.0]], [0, 2]) == pytest.approx((5.0, 6.0, -2.0 + math.pi))


def test_among_no_references_there_is_no_pose() -> None:
    assert best([]) is None

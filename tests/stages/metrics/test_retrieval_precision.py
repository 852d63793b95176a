"""Retrieved references against where they were taken and which way they look, worked by hand."""

import math

import numpy as np
import pytest
from measured_drives import Row, figures, made_drive

from omninav.stages.metrics.retrieval_precision import RetrievalPrecision
from omninav.stages.values.maps import ReferenceGraph
from omninav.stages.values.similarity import RetrievedReferences

ROBOT = (3.0, -2.0, 1.0)


def map_of(*poses: tuple[float, float, float], robot: tuple[float, float, float] = ROBOT) -> ReferenceGraph:
    """References so far from the robot (m, m, degrees)."""
    at = np.array(poses, np.float64) * (1.0, 1.0, math.pi / 180) + robot
    return ReferenceGraph(at, np.ones((len(at), 1, 2), np.float32), "histograms", np.zeros((0, 2), np.int64), "truth")


def told(map: ReferenceGraph, *answers: list[tuple[int, float, float]] | None, truth: Row = ROBOT):
    """Of answers (reference, similarity, turn in degrees) to an image each."""
    given = []
    for each in answers:
        references, similarities, turns = np.array(each or [], np.float64).reshape(-1, 3).T
        found = RetrievedReferences(references.astype(np.int64), similarities.astype(np.float32), np.radians(turns))
        given.append(None if each is None else found)
    measured = figures(RetrievalPrecision(), made_drive([truth] * len(given)), given, map)
    return measured and measured["answers"]


@pytest.mark.parametrize(
    ("place", "turn", "right"),
    [
        ((4.9, 0.0, 0.0), 0.0, 1.0),
        ((0.0, -4.9, 0.0), 0.0, 1.0),
        ((0.0, 5.1, 0.0), 0.0, 0.0),
        ((4.0, 4.0, 0.0), 0.0, 0.0),
        ((0.0, 0.0, 29.0), 0.0, 1.0),
        ((0.0, 0.0, -30.5), 0.0, 0.0),
        ((0.0, 0.0, 90.0), -70.0, 1.0),  # the robot stands turned to the right against it
        ((0.0, 0.0, 90.0), 70.0, 0.0),
        ((0.0, 0.0, -170.0), -170.0, 1.0),  # 20 degrees, the short way around
    ],
)
def test_an_answer_is_near_within_five_metres_and_thirty_degrees(
    place: tuple[float, float, float], turn: float, right: float
) -> None:
    found = told(map_of(place), [(0, 0.5, turn)])
    assert (found["nearby_rate"], found["first_nearby_rate"]) == (right, right)


def test_an_answer_at_the_limits_is_near(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("omninav.stages.metrics.retrieval_precision.WITHIN_DEG", 90.0)
    straight = (3.0, -2.0, 0.0)
    found = told(map_of((0.0, 5.0, 90.0), robot=straight), [(0, 0.5, 0.0)], truth=straight)
    assert (found["nearby_rate"], found["background_rate"]) == (1.0, 1.0)


def test_the_first_answer_is_the_most_similar_one() -> None:
    found = told(map_of((0, 0, 0), (9, 0, 0)), [(0, 0.9, 0), (1, 0.8, 0)])
    assert (found["first_nearby_rate"], found["nearby_rate"]) == (1.0, 0.5)


def test_figures_are_means_over_the_images_with_answers() -> None:
    map = map_of((0, 0, 0), (4, 0, 10), (9, 0, 0), (0, 1, 180), (0, 9, 90))
    found = told(map, [(0, 0.9, 0), (2, 0.8, 0), (3, 0.7, 0)], None, [], [(2, 0.6, 0), (1, 0.5, 0)])
    assert found == {
        "nearby_rate": pytest.approx((1 / 3 + 1 / 2) / 2),
        "first_nearby_rate": 0.5,
        "background_rate": pytest.approx(2 / 5),
        "first_similarity": pytest.approx(0.75),
        "last_similarity": pytest.approx(0.6),
    }


def test_without_truth_or_answers_there_is_nothing_to_say() -> None:
    map = map_of((0, 0, 0))
    assert told(map, [(0, 0.9, 0)], truth=None) is None
    assert told(map, None, []) is None

"""Places and hypotheses of small drives, with the evidence worked by hand (Goedemé et al. 2007, section 4.4)."""

import math

import numpy as np
import pytest
from made_views import between_looks, made_views

from omninav.pipeline import Context
from omninav.stages.mapping.loop_closure import LoopClosure
from omninav.stages.values.compared_views import ComparedViews
from omninav.stages.values.topological_map import LoopHypotheses

ROUND = between_looks([0.0, 10.0, 20.0, 0.1, 10.1, 20.1])  # two rounds of three places
PAPER = {"similarity": "ratio"}


def closed(views: ComparedViews, **parameters: object) -> LoopHypotheses:
    return LoopClosure(**parameters).step(Context("loops"), views).hypotheses  # type: ignore[arg-type]


def combined(one: tuple[float, float, float], other: tuple[float, float, float]) -> tuple[float, float, float]:
    """Dempster's rule, equation 6 with erratum 31: products that agree, by what does not conflict."""
    yes = one[0] * other[0] + one[0] * other[2] + one[2] * other[0]
    no = one[1] * other[1] + one[1] * other[2] + one[2] * other[1]
    whole = 1.0 - one[0] * other[1] - one[1] * other[0]
    return yes / whole, no / whole, one[2] * other[2] / whole


def said(similarity: float, confidence: float) -> tuple[float, float, float]:
    """Equation 9 as erratum 29 reads it."""
    return similarity * confidence, (1.0 - similarity) * confidence, 1.0 - confidence


def test_each_hypothesis_has_its_own_similarity_and_its_neighbours_evidence() -> None:
    # A single view per subcluster: the spread is 1. D = 0.1: s = 1 / 1.1. Neighbours are 2 and 4 views away of 20.
    found = closed(made_views(ROUND), **PAPER)
    assert found.pairs.tolist() == [[0, 3], [1, 4], [2, 5]]
    assert found.distances == pytest.approx([0.1] * 3)
    similarity = 1.0 / 1.1
    own = said(similarity, 0.75)
    assert found.initial == pytest.approx(np.array([own] * 3))
    near, far = (said(similarity, 1.0 - math.sin(math.pi * apart / 40.0)) for apart in (2, 4))
    expected = [
        combined(combined(own, near), far),
        combined(combined(own, near), near),
        combined(combined(own, far), near),
    ]
    assert found.masses == pytest.approx(np.array(expected))
    assert found.accepted.tolist() == [True] * 3
    assert found.cluster.tolist() == found.place.tolist() == [0, 1, 2, 0, 1, 2]
    assert found.subcluster.tolist() == [0, 1, 2, 3, 4, 5]


def test_two_places_can_be_linked_instead_of_merged() -> None:
    found = closed(made_views(ROUND), accepted="link", **PAPER)
    assert found.accepted.all()
    assert found.place.tolist() == [0, 1, 2, 3, 4, 5]


def test_support_must_exceed_what_is_asked() -> None:
    support = closed(made_views(ROUND), **PAPER).masses[:, 0]
    assert closed(made_views(ROUND), min_support=float(support.min()), **PAPER).accepted.tolist() == [
        value > support.min() for value in support
    ]


def test_nothing_is_decided_of_a_hypothesis_that_no_neighbour_has_spoken_of(monkeypatch: pytest.MonkeyPatch) -> None:
    # 2 views away is beyond a reach of 1.5.
    monkeypatch.setattr("omninav.stages.mapping.loop_closure.NEIGHBOUR_DISTANCE", 1.5)
    found = closed(made_views(ROUND), **PAPER)
    assert (found.masses == found.initial).all()
    assert (found.masses[:, 0] > 0.5).all()
    assert not found.accepted.any()


def test_views_of_which_too_few_features_match_are_not_similar() -> None:
    shares = np.ones((6, 6))
    shares[1, 4] = shares[4, 1] = 0.39
    shares[2, 5] = shares[5, 2] = 0.4
    found = closed(made_views(ROUND, shares), **PAPER)
    assert found.initial[1] == pytest.approx(said(0.0, 0.75))
    assert found.initial[2] == pytest.approx(said(1.0 / 1.1, 0.75))
    assert found.distances == pytest.approx([0.1] * 3)


@pytest.mark.parametrize(("form", "similarity"), [("ratio", 2.0 / 3.0), ("gaussian", math.exp(-0.125))])
def test_distances_are_scaled_by_their_spread_within_subclusters(form: str, similarity: float) -> None:
    # Within the parts two views are 0.2 apart, so that a distance of 0.1 is half of the spread.
    looks = [0.0, 0.2, 9.0, 9.2, 0.3, 0.5]
    found = closed(made_views(between_looks(looks)), similarity=form, place_size=0.6)
    assert found.subcluster.tolist() == [0, 0, 1, 1, 2, 2]
    assert found.pairs.tolist() == [[1, 4]]  # the nearest two, not the medoids
    assert found.initial == pytest.approx(np.array([said(similarity, 0.75)]))
    medoids = closed(made_views(between_looks(looks)), similarity=form, place_size=0.6, between="medoids")
    assert medoids.pairs.tolist() == [[0, 4]]
    assert medoids.distances == pytest.approx([0.3])


def test_places_of_a_known_map_stay_together_and_are_not_questioned() -> None:
    # Place 0 of the known map has two views that are not alike, place 1 looks as place 0 does; a new view looks so too.
    looks, owners = [0.0, 9.0, 0.1, 0.2, 20.0], [0, 0, 1, -1, -1]
    views = made_views(between_looks(looks), tours=[0, 0, 0, 1, 1], owners=owners)
    found = closed(views)
    assert found.cluster.tolist() == [0, 1, 0, 0, 2]
    assert len(set(found.subcluster.tolist())) == 5
    assert found.pairs.tolist() == [[0, 3], [2, 3]]  # not the two of the known map
    assert found.place[0] == found.place[1]
    apart = closed(views, min_support=1.0)
    assert apart.place.tolist() == [0, 0, 1, 2, 3]


def test_of_a_known_place_views_of_one_look_are_one_part_wherever_they_are() -> None:
    looks, owners = [0.0, 9.0, 0.1, 9.1, 0.2], [1, 0, 1, 0, 0]
    found = closed(made_views(between_looks(looks), tours=[0] * 5, owners=owners))
    assert found.subcluster.tolist() == [0, 1, 0, 1, 2]
    assert found.place.tolist() == [0, 1, 0, 1, 1]
    assert not len(found.pairs)


def test_tours_are_not_gone_on_with() -> None:
    found = closed(made_views(between_looks([0.0, 0.1, 0.2]), tours=[1, 2, 2], orders=[0, 1000, 1001]), min_support=1.0)
    assert found.subcluster.tolist() == [0, 1, 1]
    assert found.tour.tolist() == [1, 2, 2]
    assert found.place.tolist() == [0, 1, 1]


def test_parts_of_known_places_and_of_a_new_tour_are_told_apart() -> None:
    looks, owners = [0.0, 9.0, 9.1, 0.1], [0, 1, -1, -1]
    found = closed(made_views(between_looks(looks), tours=[0, 0, 1, 1], owners=owners))
    assert found.cluster.tolist() == [0, 1, 1, 0]
    assert found.subcluster.tolist() == [0, 1, 2, 3]

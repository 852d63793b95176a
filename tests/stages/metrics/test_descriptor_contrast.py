"""A view against its own place, places aside and others."""

import numpy as np
import pytest
from measured_drives import figures

from omninav.pipeline import BadInput, Context
from omninav.stages.metrics.descriptor_contrast import DescriptorContrast, DescriptorRecognition, PlaceContrast
from omninav.stages.values.maps import ReferenceGraph
from omninav.stages.values.pose import Pose
from omninav.stages.values.similarity import Similarities

# At the robot, 1 m aside, 3 m off (neither), 6 and 9 m off; the last one where the robot is, looking the other way.
POSES = [(0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (3.0, 0.0, 0.0), (6.0, 0.0, 0.0), (9.0, 0.0, 0.0), (0.0, 0.0, np.pi)]
HERE, FAR, NAN = (0.0, 0.0, 0.0), (90.0, 0.0, 0.0), float("nan")


def own(values, at=HERE, poses=POSES, candidates=None):
    """Measures the contrast of a view `at` a pose in a map of these poses, with these similarities to them."""
    number = len(poses)
    at_poses, features = np.array(poses).reshape(number, 3), np.ones((number, 1, 2), np.float32)
    graph = ReferenceGraph(at_poses, features, "histograms", np.zeros((0, 2), np.int64), "truth")
    alike = np.array(values, np.float32)
    similarities = Similarities(alike if alike.ndim == 2 else alike[:, None], candidates)
    return DescriptorContrast().step(Context("own"), similarities, at and Pose(*at), graph).likeness


def test_a_panorama_is_compared_at_the_robots_heading_and_elsewhere_at_the_best() -> None:
    values = np.full((6, 4), 0.1)
    values[0, 1], values[0, 2], values[3, 3] = 0.8, 0.95, 0.6  # the robot stands turned left by a quarter: column 1
    found = own(values, at=(0.0, 0.0, np.pi / 2))
    assert (found.own, found.average, found.most) == pytest.approx((0.8, 0.35, 0.6))


def test_without_the_place_in_the_map_truth_or_map_nothing_is_compared() -> None:
    assert own(np.ones(6), at=(0.0, 3.0, 0.0)) is None
    assert own(np.ones(6), at=None) is None
    assert own([], poses=[]) is None
    with pytest.raises(BadInput, match="candidates=all"):
        own([1.0], candidates=np.zeros(1, np.int64))


@pytest.mark.parametrize(
    ("off", "found"), [((0.09, 0.0), 0.9), ((0.0, -0.09), 0.9), ((0.11, 0.0), None), ((0.08, 0.08), None)]
)
def test_the_own_place_is_within_a_tenth_of_a_metre(off: tuple[float, float], found: float | None) -> None:
    likeness = own([0.9, 0.2], poses=[(3.0 + off[0], 4.0 + off[1], 0.0), FAR], at=(3.0, 4.0, 0.0))
    assert (likeness and likeness.own) == (found and pytest.approx(found))


def test_places_nearby_are_half_a_metre_to_one_and_a_half_away_and_others_from_five_on() -> None:
    xs = [0.0, 0.45, 0.5, 1.5, 1.55, 4.95, 5.0, 9.0]
    found = own([0.9, 0.1, 0.5, 0.7, 0.1, 0.99, 0.4, 0.2], poses=[(0.0, x, 0.0) for x in xs])
    assert (found.own, found.nearby, found.average, found.most) == pytest.approx((0.9, 0.6, 0.3, 0.4))
    assert np.isnan(own([0.9, 0.4], poses=[HERE, (0.0, 5.0, 0.0)]).nearby)
    assert own([0.9, 0.4], poses=[HERE, (0.0, 4.0, 0.0)]) is None


def test_a_view_that_looks_another_way_by_more_than_five_degrees_is_not_of_the_place() -> None:
    assert own([0.9, 0.2], poses=[(0.0, 0.0, np.radians(4.9)), FAR]).own == pytest.approx(0.9)
    assert own([0.9, 0.2], poses=[(0.0, 0.0, np.radians(-5.1)), FAR]) is None
    # Compared at 36 headings the robot's own is 3 degrees off the nearest.
    values = np.full((2, 36), 0.1)
    values[0, 4] = 0.8
    turned = own(values, poses=[(0.0, 0.0, np.radians(-20.0)), FAR], at=(0.0, 0.0, np.radians(23.0)))
    assert turned.own == pytest.approx(0.8)


def test_a_view_at_the_limits_is_of_the_place(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("omninav.stages.metrics.descriptor_contrast.OWN_M", 0.125)
    monkeypatch.setattr("omninav.stages.metrics.descriptor_contrast.WITHIN_DEG", 90.0)
    assert own([0.9, 0.2], poses=[(0.0, 0.125, np.pi / 2), FAR]).own == pytest.approx(0.9)


def test_what_is_lost_is_a_share_of_what_there_is_to_lose() -> None:
    views = [PlaceContrast(0.9, 0.7, 0.5, 0.8), None, PlaceContrast(0.6, NAN, 0.2, 0.7)]
    assert figures(DescriptorRecognition(), views)["descriptor_contrast"] == {
        "images": 2,
        "similarity": pytest.approx(0.75),
        "similarity_nearby": pytest.approx(0.7),
        "similarity_elsewhere": pytest.approx(0.35),
        "lost": pytest.approx((0.1 / 0.5 + 0.4 / 0.8) / 2),
        "lost_nearby": pytest.approx(0.3 / 0.5),
        "recognition_rate": 0.5,
    }


def test_without_views_nothing_is_told_and_without_any_nearby_nothing_of_those() -> None:
    assert figures(DescriptorRecognition(), [None]) is None
    found = figures(DescriptorRecognition(), [PlaceContrast(0.5, NAN, 0.0, 0.5)])["descriptor_contrast"]
    assert (found["similarity_nearby"], found["lost_nearby"], found["recognition_rate"]) == (None, None, 0.0)

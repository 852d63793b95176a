"""A view against its own place, places aside and others; and answers against where they were taken."""

import numpy as np
import pytest
from small_run import collected

from omninav.pipeline import BadInput, Context, Tick
from omninav.stages.metrics.descriptor_contrast import DescriptorContrast, DescriptorRecognition, PlaceContrast
from omninav.stages.metrics.retrieval_precision import RetrievalPrecision
from omninav.stages.values.maps import ReferenceGraph
from omninav.stages.values.pose import Pose
from omninav.stages.values.similarity import Answers, Similarities

# At the robot, 1 m aside, 3 m off (neither), 6 and 9 m off; the last one where the robot is, looking the other way.
POSES = np.array([[0.0, 0, 0], [1, 0, 0], [3, 0, 0], [6, 0, 0], [9, 0, 0], [0, 0, np.pi]])
MAP = ReferenceGraph(POSES, np.ones((6, 1, 2), np.float32), "histograms", np.zeros((0, 2), np.int64), "truth")


def test_each_reference_counts_by_where_it_was_taken() -> None:
    values = np.array([[0.9], [0.7], [0.99], [0.5], [0.3], [1.0]], np.float32)
    found = DescriptorContrast().step(Context("own"), Similarities(values), Pose(0.0, 0.0, 0.0), MAP).likeness
    assert found is not None
    assert (found.own, found.nearby, found.average, found.most) == pytest.approx((0.9, 0.7, 0.4, 0.5))


def test_a_panorama_is_compared_at_the_robots_heading_and_elsewhere_at_the_best() -> None:
    values = np.full((6, 4), 0.1, np.float32)
    values[0, 1], values[0, 2], values[3, 3] = 0.8, 0.95, 0.6  # the robot stands turned left by a quarter: column 1
    found = DescriptorContrast().step(Context("own"), Similarities(values), Pose(0.0, 0.0, np.pi / 2), MAP).likeness
    assert found is not None
    assert (found.own, found.average, found.most) == pytest.approx((0.8, 0.35, 0.6))


def test_without_the_place_in_the_map_nothing_is_compared() -> None:
    values = np.ones((6, 1), np.float32)
    assert DescriptorContrast().step(Context("own"), Similarities(values), Pose(0.0, 3.0, 0.0), MAP).likeness is None
    with pytest.raises(BadInput, match="candidates=all"):
        DescriptorContrast().step(
            Context("own"), Similarities(values[:1], np.zeros(1, np.int64)), Pose(0.0, 0.0, 0.0), MAP
        )


def test_what_is_lost_is_a_share_of_what_there_is_to_lose() -> None:
    views = [PlaceContrast(0.9, 0.7, 0.5, 0.8), None, PlaceContrast(0.6, float("nan"), 0.2, 0.7)]
    out = DescriptorRecognition().step(Context("own"), views)
    assert out.metrics is not None
    found = out.metrics.values["descriptor_contrast"]
    assert (found["images"], found["similarity"], found["recognition_rate"]) == (2, pytest.approx(0.75), 0.5)
    assert found["lost"] == pytest.approx((0.1 / 0.5 + 0.4 / 0.8) / 2)
    assert (found["lost_nearby"], found["similarity_nearby"]) == (pytest.approx(0.3 / 0.5), pytest.approx(0.7))


def test_an_answer_is_right_where_it_was_taken_near_by_and_looks_the_same_way() -> None:
    drive = collected([Tick(n, n, 0, n, n == 0) for n in range(2)], [Pose(0.0, 0.0, 0.0)] * 2)
    answers = [
        Answers(np.array([1, 5, 3]), np.array([0.9, 0.8, 0.7], np.float32), np.zeros(3)),  # near, turned round, far
        Answers(np.array([4, 2, 0]), np.array([0.7, 0.6, 0.5], np.float32), np.zeros(3)),
    ]
    out = RetrievalPrecision().step(Context("answers"), drive, answers, MAP)
    assert out.metrics is not None
    found = out.metrics.values["answers"]
    assert found["nearby_rate"] == pytest.approx((1 / 3 + 2 / 3) / 2)
    assert found["first_nearby_rate"] == pytest.approx(0.5)
    assert found["background_rate"] == pytest.approx(3 / 6)
    assert (found["first_similarity"], found["last_similarity"]) == pytest.approx((0.8, 0.6))


def own(values, *, at=(0.0, 0.0, 0.0), poses=POSES, **parameters):
    graph = ReferenceGraph(
        np.array(poses, np.float64),
        np.ones((len(poses), 1, 2), np.float32),
        "histograms",
        np.zeros((0, 2), np.int64),
        "truth",
    )
    similarities = Similarities(np.array(values, np.float32).reshape(len(poses), -1))
    return DescriptorContrast(**parameters).step(Context("own"), similarities, Pose(*at), graph).likeness


@pytest.mark.parametrize(
    ("off", "found"), [((0.09, 0.0), 0.9), ((0.0, -0.09), 0.9), ((0.11, 0.0), None), ((0.08, 0.08), None)]
)
def test_the_own_place_is_within_a_tenth_of_a_metre(off: tuple[float, float], found: float | None) -> None:
    likeness = own([0.9, 0.2], poses=[(3.0 + off[0], 4.0 + off[1], 0.0), (90.0, 0.0, 0.0)], at=(3.0, 4.0, 0.0))
    assert (likeness and likeness.own) == (found and pytest.approx(found))


def test_places_nearby_are_half_a_metre_to_one_and_a_half_away_and_others_from_five_on() -> None:
    xs = [0.0, 0.45, 0.5, 1.5, 1.55, 4.95, 5.0, 9.0]
    values = [0.9, 0.1, 0.5, 0.7, 0.1, 0.99, 0.4, 0.2]
    found = own(values, poses=[(0.0, x, 0.0) for x in xs])
    assert (found.own, found.nearby, found.average, found.most) == pytest.approx((0.9, 0.6, 0.3, 0.4))
    alone = own([0.9, 0.4], poses=[(0.0, 0.0, 0.0), (0.0, 5.0, 0.0)])
    assert np.isnan(alone.nearby)
    assert own([0.9, 0.4], poses=[(0.0, 0.0, 0.0), (0.0, 4.0, 0.0)]) is None


def test_a_view_that_looks_another_way_by_more_than_five_degrees_is_not_of_the_place() -> None:
    far = (90.0, 0.0, 0.0)
    assert own([0.9, 0.2], poses=[(0.0, 0.0, np.radians(4.9)), far]).own == pytest.approx(0.9)
    assert own([0.9, 0.2], poses=[(0.0, 0.0, np.radians(-5.1)), far]) is None
    # Compared at 36 headings the robot's own is 3 degrees off the nearest.
    values = np.full((2, 36), 0.1)
    values[0, 4] = 0.8
    assert own(
        values, poses=[(0.0, 0.0, np.radians(-20.0)), far], at=(0.0, 0.0, np.radians(23.0))
    ).own == pytest.approx(0.8)


def test_a_view_at_the_limits_is_of_the_place(monkeypatch: pytest.MonkeyPatch) -> None:
    poses = [(0.0, 0.125, np.pi / 2), (90.0, 0.0, 0.0)]
    monkeypatch.setattr("omninav.stages.metrics.descriptor_contrast.OWN_M", 0.125)
    monkeypatch.setattr("omninav.stages.metrics.descriptor_contrast.WITHIN_DEG", 90.0)
    assert own([0.9, 0.2], poses=poses).own == pytest.approx(0.9)


def test_without_truth_or_map_nothing_is_compared_and_without_views_nothing_is_told() -> None:
    values = Similarities(np.ones((6, 1), np.float32))
    assert DescriptorContrast().step(Context("own"), values, None, MAP).likeness is None
    empty = ReferenceGraph.empty()
    none = Similarities(np.ones((0, 1), np.float32))
    assert DescriptorContrast().step(Context("own"), none, Pose(0.0, 0.0, 0.0), empty).likeness is None
    assert DescriptorRecognition().step(Context("own"), [None]).metrics is None
    lone = DescriptorRecognition().step(Context("own"), [PlaceContrast(0.5, float("nan"), 0.0, 0.5)]).metrics
    found = lone.values["descriptor_contrast"]
    assert (found["similarity_nearby"], found["lost_nearby"], found["recognition_rate"]) == (None, None, 0.0)
    assert (found["lost"], found["similarity_elsewhere"], found["images"]) == (0.5, 0.0, 1)

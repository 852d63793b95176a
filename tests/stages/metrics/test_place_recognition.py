import dataclasses

import numpy as np
import pytest
from measured_drives import figures
from small_run import reference_graph, small_run

from omninav.pipeline import Context
from omninav.stages.metrics.place_recognition import PlaceRecognition, RankedReferences, RankReferences, recalls
from omninav.stages.values.similarity import Similarities

MODULE = "omninav.stages.metrics.place_recognition"
REFERENCES = np.column_stack([10.0 * np.arange(6), np.zeros(6)])


def recalled(position: tuple[float, float], ranked: list[list[int]], metres: float, references=REFERENCES) -> dict:
    """The recall of images at one spot whose references are ranked so."""
    return recalls(np.full((len(ranked), 2), position), [np.array(best) for best in ranked], references, metres)


def test_an_image_far_from_every_reference_does_not_count():
    found = recalls(np.array([(0.5, 0.0), (5.0, 0.0)]), [np.array([0]), np.array([0])], REFERENCES, 2.0)
    assert (found["queries"], found["recall_at_1"]) == (1, 1.0)
    nowhere = recalled((5.0, 0.0), [[0]], 2.0)
    assert (nowhere["queries"], nowhere["recall_at_1"]) == (0, None)


def ranking(values: np.ndarray, candidates: np.ndarray | None = None) -> list[int]:
    return RankReferences().step(Context("ranked"), Similarities(values, candidates)).ranked.references.tolist()


def test_references_are_ranked_by_their_best_heading_and_named_by_their_number_in_the_map(
    monkeypatch: pytest.MonkeyPatch,
):
    values = np.array([[0.1, 0.2], [0.9, 0.0], [0.3, 0.5]], np.float32)
    monkeypatch.setattr(f"{MODULE}.BEST", 2)
    assert ranking(values) == [1, 2]
    assert ranking(values, np.array([7, 3, 9])) == [3, 9]


def test_ten_references_are_kept_the_first_of_equals_first_and_none_where_none_was_compared():
    values = np.zeros((14, 3), np.float32)
    values[5, 1] = 0.5
    assert ranking(values) == [5, 0, 1, 2, 3, 4, 6, 7, 8, 9]
    assert ranking(values[:0]) == []


def test_recall_is_the_share_of_images_with_a_near_reference_among_the_best():
    found = [recalled((3.0, 0.0), [[5, 4, 3, 2, 1, 0], [1, 0, 2, 3, 4, 5]], metres) for metres in (2.0, 4.0, 8.0)]
    assert [each["queries"] for each in found] == [0, 2, 2]
    assert (found[1]["recall_at_1"], found[1]["recall_at_5"], found[1]["recall_at_10"]) == (0.0, 0.5, 1.0)
    assert found[2]["recall_at_1"] == 0.5


def test_a_reference_at_the_distance_itself_is_right_and_lies_in_any_direction():
    spots = np.array([(0.0, 0.0), (0.0, 30.0)])
    found = recalls(np.array([(0.0, 2.0), (2.0, 30.0)]), [np.array([0]), np.array([1])], spots, 2.0)
    assert (found["queries"], found["recall_at_1"], found["distance_m"]) == (2, 1.0, 2.0)
    assert recalled((0.0, 2.0625), [[0]], 2.0, spots)["queries"] == 0
    wrong = recalled((0.0, 2.0), [[1]], 2.0, spots)
    assert (wrong["queries"], wrong["recall_at_1"]) == (1, 0.0)


@pytest.mark.parametrize(
    ("place", "recall"),
    [(0, [1, 1, 1]), (1, [0, 1, 1]), (4, [0, 1, 1]), (5, [0, 0, 1]), (9, [0, 0, 1]), (10, [0, 0, 0])],
)
def test_the_first_five_and_ten_count(place: int, recall: list[float]):
    spots = np.column_stack([100.0 * np.arange(12), np.zeros(12)])
    found = recalled((0.0, 0.0), [np.insert(np.arange(1, 12), place, 0).tolist()], 1.0, spots)
    assert [found[f"recall_at_{rank}"] for rank in (1, 5, 10)] == recall


def test_an_image_without_a_ranking_is_not_recalled_and_only_the_last_log_counts(monkeypatch: pytest.MonkeyPatch):
    run = small_run(frames=10, logs=2)
    away = [np.hypot(*(run.map.poses[:, :2] - (pose.x, pose.y)).T) for pose in run.truth]
    ranked = [RankedReferences(np.argsort(-metres)) for metres in away[:10]]
    ranked += [RankedReferences(np.argsort(metres)) for metres in away[10:]]
    ranked[12] = None
    drive = run.drive
    drive.truth[13] = np.nan
    monkeypatch.setattr(f"{MODULE}.DISTANCES_M", (2.0,))
    out = PlaceRecognition().step(Context("recognition"), drive, ranked, run.map)
    found = out.metrics.values["place_recognition"]
    assert (found["queries"], found["recall_at_1"], found["distance_m"]) == (9, pytest.approx(8 / 9), 2.0)
    assert found["at_distances"]["queries"] == [9]
    assert out.table.rows == (("2", "88.9", "88.9", "88.9", 9),)
    for map in (None, dataclasses.replace(run.map, pose_source="odometry"), reference_graph(0)):
        assert figures(PlaceRecognition(), drive, ranked, map) is None
    assert figures(PlaceRecognition(), run.blind, ranked, run.map) is None


def test_recall_is_told_at_half_a_metre_one_two_and_five(monkeypatch: pytest.MonkeyPatch):
    run = small_run(frames=5)
    lists = [RankedReferences(np.array([0])) for _ in run.truth]
    far = dataclasses.replace(run.map, poses=run.map.poses + 1000.0)
    out = PlaceRecognition().step(Context("recognition"), run.drive, lists, far)
    assert out.table.rows == tuple((name, "–", "–", "–", 0) for name in ("0.5", "1", "2", "5"))
    monkeypatch.setattr(f"{MODULE}.DISTANCES_M", ())
    assert figures(PlaceRecognition(), run.drive, lists, run.map)["place_recognition"]["at_distances"] == {}

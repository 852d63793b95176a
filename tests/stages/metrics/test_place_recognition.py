import dataclasses

import numpy as np
import pytest
from small_run import reference_graph, small_run

from omninav.pipeline import Context
from omninav.stages.metrics.place_recognition import PlaceRecognition, RankedReferences, RankReferences, recalls
from omninav.stages.values.similarity import Similarities

CTX = Context("recognition")
REFERENCES = np.array([(0.0, 0.0), (10.0, 0.0), (20.0, 0.0), (30.0, 0.0), (40.0, 0.0), (50.0, 0.0)])


def test_recall_is_the_share_of_images_with_a_near_reference_among_the_best():
    ranked = [np.array(best) for best in ([0, 1, 2, 3, 4], [5, 4, 3, 2, 1], [0, 2, 3, 4, 5], [3, 2, 1, 0, 4])]
    found = recalls(np.full((4, 2), (10.5, 0.0)), ranked, REFERENCES, 2.0)
    assert found["queries"] == 4
    assert found["recall_at_1"] == 0.0
    assert found["recall_at_5"] == 0.75


def test_an_image_far_from_every_reference_does_not_count():
    found = recalls(np.array([(0.5, 0.0), (5.0, 0.0)]), [np.array([0]), np.array([0])], REFERENCES, 2.0)
    assert (found["queries"], found["recall_at_1"]) == (1, 1.0)
    nowhere = recalls(np.array([(5.0, 0.0)]), [np.array([0])], REFERENCES, 2.0)
    assert (nowhere["queries"], nowhere["recall_at_1"]) == (0, None)


def test_references_are_ranked_by_their_best_heading_and_named_by_their_number_in_the_map(
    monkeypatch: pytest.MonkeyPatch,
):
    values = np.array([[0.1, 0.2], [0.9, 0.0], [0.3, 0.5]], np.float32)
    monkeypatch.setattr("omninav.stages.metrics.place_recognition.BEST", 2)
    assert RankReferences().step(CTX, Similarities(values, None)).ranked.references.tolist() == [1, 2]
    some = Similarities(values, np.array([7, 3, 9]))
    monkeypatch.setattr("omninav.stages.metrics.place_recognition.BEST", 2)
    assert RankReferences().step(CTX, some).ranked.references.tolist() == [3, 9]


def test_a_run_whose_best_reference_is_always_the_nearest_has_full_recall_and_none_without_truth():
    run = small_run(frames=20)
    away = [np.hypot(*(run.map.poses[:, :2] - (pose.x, pose.y)).T) for pose in run.truth]
    ranked = [RankedReferences(np.argsort(metres)) for metres in away]
    found = PlaceRecognition().step(CTX, run.drive, ranked, run.map).metrics.values["place_recognition"]
    assert found["recall_at_1"] == pytest.approx(1.0)
    assert PlaceRecognition().step(CTX, run.blind, ranked, run.map).metrics is None


def test_recall_is_told_for_several_numbers_and_distances(monkeypatch: pytest.MonkeyPatch):
    ranked = [np.array([5, 4, 3, 2, 1, 0]), np.array([1, 0, 2, 3, 4, 5])]
    found = [recalls(np.full((2, 2), (3.0, 0.0)), ranked, REFERENCES, metres) for metres in (2.0, 4.0, 8.0)]
    assert [each["queries"] for each in found] == [0, 2, 2]
    assert (found[1]["recall_at_1"], found[1]["recall_at_5"], found[1]["recall_at_10"]) == (0.0, 0.5, 1.0)
    assert found[2]["recall_at_1"] == 0.5
    run = small_run(frames=20)
    lists = [RankedReferences(np.array([0])) for _ in run.truth]
    monkeypatch.setattr("omninav.stages.metrics.place_recognition.DISTANCES_M", (0.5, 100.0))
    out = PlaceRecognition().step(CTX, run.drive, lists, run.map)
    assert out.metrics.values["place_recognition"]["at_distances"]["recall_at_1"][1] == 1.0
    assert [row[0] for row in out.table.rows] == ["0.5", "100"]


def test_a_reference_at_the_distance_itself_is_right_and_lies_in_any_direction():
    spots = np.array([(0.0, 0.0), (0.0, 30.0)])
    found = recalls(np.array([(0.0, 2.0), (2.0, 30.0)]), [np.array([0]), np.array([1])], spots, 2.0)
    assert (found["queries"], found["recall_at_1"], found["distance_m"]) == (2, 1.0, 2.0)
    beyond = recalls(np.array([(0.0, 2.0625)]), [np.array([0])], spots, 2.0)
    assert beyond["queries"] == 0
    wrong = recalls(np.array([(0.0, 2.0)]), [np.array([1])], spots, 2.0)
    assert (wrong["queries"], wrong["recall_at_1"]) == (1, 0.0)


def test_the_first_five_and_ten_count():
    spots = np.array([(float(100 * k), 0.0) for k in range(12)])
    position = np.zeros((1, 2))

    def recall(place: int) -> list[float]:
        ranked = [k for k in range(1, 12)]
        ranked.insert(place, 0)
        found = recalls(position, [np.array(ranked)], spots, 1.0)
        return [found[f"recall_at_{rank}"] for rank in (1, 5, 10)]

    assert [recall(place) for place in (0, 1, 4, 5, 9, 10)] == [
        [1.0, 1.0, 1.0],
        [0.0, 1.0, 1.0],
        [0.0, 1.0, 1.0],
        [0.0, 0.0, 1.0],
        [0.0, 0.0, 1.0],
        [0.0, 0.0, 0.0],
    ]


def test_ten_references_are_kept_the_first_of_equals_first_and_none_where_none_was_compared():
    values = np.zeros((14, 3), np.float32)
    values[5, 1] = 0.5
    assert RankReferences().step(CTX, Similarities(values, None)).ranked.references.tolist() == [
        5,
        0,
        1,
        2,
        3,
        4,
        6,
        7,
        8,
        9,
    ]
    assert RankReferences().step(CTX, Similarities(values[:0], None)).ranked.references.tolist() == []


def test_an_image_without_a_ranking_is_not_recalled_and_only_the_last_log_counts(monkeypatch: pytest.MonkeyPatch):
    run = small_run(frames=10, logs=2)
    away = [np.hypot(*(run.map.poses[:, :2] - (pose.x, pose.y)).T) for pose in run.truth]
    ranked = [RankedReferences(np.argsort(-metres)) for metres in away[:10]]
    ranked += [RankedReferences(np.argsort(metres)) for metres in away[10:]]
    ranked[12] = None
    drive = run.drive
    drive.truth[13] = np.nan
    monkeypatch.setattr("omninav.stages.metrics.place_recognition.DISTANCES_M", (2.0,))
    out = PlaceRecognition().step(CTX, drive, ranked, run.map)
    found = out.metrics.values["place_recognition"]
    assert (found["queries"], found["recall_at_1"], found["distance_m"]) == (9, pytest.approx(8 / 9), 2.0)
    assert found["at_distances"]["queries"] == [9]
    assert out.table.rows == (("2", "88.9", "88.9", "88.9", 9),)
    assert PlaceRecognition().step(CTX, drive, ranked, None).metrics is None
    odometry = dataclasses.replace(run.map, pose_source="odometry")
    assert PlaceRecognition().step(CTX, drive, ranked, odometry).metrics is None
    assert PlaceRecognition().step(CTX, drive, ranked, reference_graph(0)).metrics is None


def test_recall_is_told_at_half_a_metre_one_two_and_five(monkeypatch: pytest.MonkeyPatch):
    run = small_run(frames=5)
    lists = [RankedReferences(np.array([0])) for _ in run.truth]
    far = dataclasses.replace(run.map, poses=run.map.poses + 1000.0)
    out = PlaceRecognition().step(CTX, run.drive, lists, far)
    assert out.table.rows == tuple((name, "–", "–", "–", 0) for name in ("0.5", "1", "2", "5"))
    monkeypatch.setattr("omninav.stages.metrics.place_recognition.DISTANCES_M", ())
    alone = PlaceRecognition().step(CTX, run.drive, lists, run.map)
    assert alone.metrics.values["place_recognition"]["at_distances"] == {}

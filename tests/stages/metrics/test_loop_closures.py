import dataclasses
from pathlib import Path

import numpy as np
import pytest
from made_places import made_map

from omninav.pipeline import Context
from omninav.pipeline.engine.artifact import write_artifact
from omninav.stages.metrics.loop_closures import LoopClosures, average_precision, neighbours, precision_recall
from omninav.stages.values.topological_map import LoopHypotheses


def test_hypotheses_of_equal_support_are_accepted_together_whatever_their_order():
    assert average_precision(np.array([0.9, 0.2, 0.8]), np.array([True, False, True])) == 1.0
    support = np.array([0.5, 0.5])
    assert average_precision(support, np.array([True, False])) == average_precision(support, np.array([False, True]))


def test_precision_and_recall_worked_by_hand():
    precision, recall = precision_recall(np.array([0.9, 0.7, 0.7, 0.1]), np.array([True, False, True, False]))
    assert precision == pytest.approx([1.0, 2 / 3, 2 / 4])
    assert recall == pytest.approx([0.5, 1.0, 1.0])


MAP = made_map([(0.0, 0.0), (3.0, 0.0), (3.0, 4.0), (9.0, 9.0)], {(0, 1): 2, (1, 2): 0})
"""Three places in a row, and one that no path leads to; the two path images of the first link stand at its place."""
STRETCHES = [(5, 0.0, 0.0), (5, 10.0, 0.0), (10, 50.0, 50.0), (5, 0.0, 2.0), (5, 10.0, 2.5), (10, 0.0, -7.0)]
"""Pictures, and where the first of them was taken; the others lie half a metre further east each."""
PAIRS = [(2, 22), (7, 27), (2, 32), (4, 5), (9, 19)]
"""2 m apart, 2.5 m, 7 m, 8 m in one stretch of the drive, and far."""


def hypotheses(pose_source="truth"):
    numbers = np.repeat(np.arange(len(STRETCHES)), [number for number, *_ in STRETCHES])
    poses = np.array([(x + 0.5 * k, y, 0.0) for number, x, y in STRETCHES for k in range(number)])
    support = np.array([0.9, 0.4, 0.6, 0.8, 0.1])
    masses = np.stack([support, np.zeros(5), 1.0 - support], axis=1)
    place = np.array([0, 1, 3, 0, 1, 2])[numbers]
    accepted = np.array([True, False, True, True, False])
    return LoopHypotheses(
        poses, numbers, numbers, place, numbers * 0, np.array(PAIRS), np.ones(5), masses, masses, accepted, pose_source
    )


def measured(hypotheses, map=MAP, **parameters):
    out = LoopClosures(**parameters).step(Context("loops"), hypotheses, map)
    return out.metrics.values, out.plot


def test_a_hypothesis_is_right_where_some_images_of_both_were_taken_within_near_m(monkeypatch: pytest.MonkeyPatch):
    loops = measured(hypotheses())[0]["loops"]
    counts = ("hypotheses", "accepted", "rejected", "wrong", "precision", "recall")
    assert [loops[name] for name in counts] == [5, 3, 2, 2, pytest.approx(1 / 3), 0.5]
    assert [loops["loop_closures"][name] for name in counts] == [4, 2, 2, 1, 0.5, 0.5]
    assert loops["loop_closures"]["average_precision"] == pytest.approx((1.0 + 2.0 / 3.0) / 2.0)
    assert [loops["merged"][name] for name in counts] == [4, 2, 2, 0, 1.0, 1.0]
    found = []
    for near in (2.4, 7.0):
        monkeypatch.setattr("omninav.stages.metrics.loop_closures.NEAR_M", near)
        found.append(measured(hypotheses())[0]["loops"]["loop_closures"])
    nearer, farther = found
    assert (nearer["precision"], nearer["recall"]) == (0.5, 1.0)
    assert (farther["precision"], farther["recall"]) == (1.0, pytest.approx(2 / 3))


def test_a_loop_closure_leaps_over_at_least_so_many_images(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr("omninav.stages.metrics.loop_closures.MIN_IMAGES_BETWEEN", 11)
    assert measured(hypotheses())[0]["loops"]["loop_closures"]["hypotheses"] == 3
    monkeypatch.setattr("omninav.stages.metrics.loop_closures.MIN_IMAGES_BETWEEN", 1)
    assert measured(hypotheses())[0]["loops"]["loop_closures"]["hypotheses"] == 5


def test_other_thresholds_of_support_accept_what_lies_above_them():
    found = measured(hypotheses())[0]["loops"]["at_supports"]
    assert found["support"] == [round(k / 20, 2) for k in range(1, 20)]
    assert found["accepted"] == [4] + [3] * 6 + [2] * 4 + [1] * 6 + [0] * 2
    assert found["wrong"] == [2] + [1] * 10 + [0] * 8
    assert found["precision"][-3:] == [1.0, None, None]


def test_there_is_a_curve_and_its_area_where_a_loop_closure_is_right(monkeypatch: pytest.MonkeyPatch):
    plot = measured(hypotheses())[1]
    assert "2 of 4 right" in plot.caption
    assert "83.3 %" in plot.caption
    monkeypatch.setattr("omninav.stages.metrics.loop_closures.NEAR_M", 0.5)
    values, none = measured(hypotheses())
    assert values["loops"]["loop_closures"]["average_precision"] is none is None


def test_each_step_of_the_curve_is_as_high_as_the_precision_where_it_ends():
    drawn = measured(hypotheses())[1].content.decode()
    # Both axes from 0 to 1, over 484 x 260 points from (64, 290) up: recall 0 to 1/2 at 1, then 1 at 2/3, then at 1/2.
    assert "M64.0 30.0L306.0 30.0L306.0 160.0L306.0 116.7L548.0 116.7L548.0 160.0L548.0 160.0" in drawn


def test_without_truth_it_is_not_said_what_is_right():
    values, plot = measured(hypotheses("odometry"))
    assert plot is None
    assert values["loops"]["precision"] is values["loops"]["loop_closures"]["average_precision"] is None
    assert values["loops"]["at_supports"]["recall"] == [None] * 19
    assert (values["loops"]["accepted"], values["loops"]["merged"]["accepted"]) == (3, 2)


def test_a_map_is_measured_by_its_places_parts_paths_and_the_bytes_of_its_file(tmp_path: Path):
    write_artifact(tmp_path / "map.omap", MAP)
    size = (tmp_path / "map.omap").stat().st_size
    assert measured(hypotheses())[0]["map"] == {
        "size_bytes": size,
        "places": 4,
        "links": 2,
        "parts": 2,
        "views": 6,
        "place_size_bytes": size / 4,
        "pose_source": "truth",
        "step_m": {"median": 1.5, "p90": pytest.approx(3.7), "max": 4.0},
    }
    alone = dataclasses.replace(made_map([(0.0, 0.0)], {}), pose_source="odometry")
    assert "step_m" not in measured(hypotheses(), alone)[0]["map"]


def test_neighbours_are_judged_by_what_was_known_before_they_spoke():
    initial = np.array([[0.6, 0.2, 0.2], [0.4, 0.4, 0.2], [0.7, 0.1, 0.2]])
    masses = np.array([[0.3, 0.6, 0.1], [0.8, 0.1, 0.1], [0.7, 0.1, 0.2]])
    found = neighbours(initial, masses, np.array([False, True, True]))
    assert found["wrong_without"] == 1.0
    assert found["right_alone"] == 0.5
    assert found["area_gain"] == pytest.approx(1.0 - (0.5 * 1.0 + 0.5 * 2.0 / 3.0))
    assert neighbours(initial, masses, None)["area_gain"] is None


def test_a_support_of_one_half_accepts_nothing():
    initial = np.array([[0.5, 0.5, 0.0], [0.9, 0.1, 0.0]])
    assert neighbours(initial, initial, np.array([False, True]))["wrong_without"] == 0.0


def test_neighbours_that_said_nothing_bring_nothing():
    known = np.array([[0.6, 0.2, 0.2], [0.7, 0.1, 0.2], [0.9, 0.0, 0.1], [0.2, 0.6, 0.2]])
    found = neighbours(known, known, np.array([False, False, True, False]))
    assert found == {"area_gain": 0.0, "wrong_without": 2.0, "right_alone": 1.0}
    assert neighbours(known, known, np.ones(4, np.bool_))["wrong_without"] == 0.0


def test_three_metres_are_not_near_and_nine_images_are_no_leap():
    given = hypotheses()
    poses = given.poses.copy()
    poses[given.subcluster == 4, 1] = 3.0
    assert measured(dataclasses.replace(given, poses=poses))[0]["loops"]["recall"] == 1.0  # of the first alone
    close = dataclasses.replace(given, pairs=np.array([*PAIRS[:4], (9, 18)]))
    assert measured(close)[0]["loops"]["loop_closures"]["hypotheses"] == 3

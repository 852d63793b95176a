"""How often the believed place is the right one, on a drive along four places."""

import dataclasses

import numpy as np
import pytest
from made_places import made_map
from small_run import collected

from omninav.pipeline import Context, Tick
from omninav.pipeline.graph.problems import BadInput
from omninav.stages.fusion.place_prior import PlacePrior
from omninav.stages.metrics.place_accuracy import PlaceAccuracy
from omninav.stages.values.belief import PlaceBelief
from omninav.stages.values.pose import Pose

ROW = made_map([(0.0, 0.0), (2.0, 0.0), (4.0, 0.0), (6.0, 0.0)], {(0, 1): 0, (1, 2): 0, (2, 3): 0})


@pytest.fixture(autouse=True)
def few_updates(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("omninav.stages.metrics.place_accuracy.UPDATES", 3)


def tick(index: int) -> Tick:
    return Tick(index=index, stamp=index, log=0, frame=index, first_of_log=index == 0)


def believed(place: int) -> PlaceBelief:
    return PlaceBelief(np.eye(4)[place], ROW.poses)


def hits(places, xs, begun):
    out = PlaceAccuracy().step(
        Context("hits"),
        collected([tick(k) for k in range(len(xs))], [None if x is None else Pose(x, 0.0, 0.0) for x in xs]),
        [believed(place) for place in places],
        [believed(0) if k in begun else None for k in range(len(xs))],
        ROW,
    )
    return out.metrics


def test_a_hit_is_the_place_whose_medoid_was_taken_closest_and_a_near_one_its_neighbour():
    found = hits([0, 1, 1, 3], [0.4, 0.4, 2.4, 0.4], {0}).values["localisation"]
    assert found["images"] == 4
    assert found["accuracy"] == 0.5
    assert found["adjacent_accuracy"] == 0.75
    assert found["place_distance_m"] == pytest.approx((0.4 + 1.6) / 2)


def test_updates_are_counted_from_where_the_belief_began():
    found = hits([3, 0, 0, 0, 3], [0.0] * 5, {0, 3}).values["localisation"]
    assert found["accuracy_after"] == [0.5, 0.5, 1.0]


def test_a_long_place_is_right_where_one_of_its_images_was_taken_closest(monkeypatch: pytest.MonkeyPatch):
    made = made_map([(0.0, 0.0), (2.0, 0.0)], {(0, 1): 1})
    poses = made.poses.copy()
    poses[2, 0] = 1.2  # the path image on the way, which belongs to the first place
    long = dataclasses.replace(made, poses=poses)
    beliefs = [PlaceBelief(np.eye(2)[0], long.poses[:2])]
    monkeypatch.setattr("omninav.stages.metrics.place_accuracy.UPDATES", 1)
    out = PlaceAccuracy().step(Context("hits"), collected([tick(0)], [Pose(1.25, 0.0, 0.0)]), beliefs, beliefs, long)
    found = out.metrics.values["localisation"]
    assert found["accuracy_after"] == [0.0]
    assert found["image_accuracy_after"] == [1.0]


def test_a_medoid_hardly_further_than_the_closest_counts_as_beside_it():
    apart = hits([0, 0, 1], [1.2, 1.3, 1.3], {0, 1, 2}).values["localisation"]  # medoids are at 0 and 2 m
    assert apart["accuracy_after"][0] == pytest.approx(1 / 3)
    assert apart["tolerant_accuracy_after"][0] == pytest.approx(2 / 3)  # 0.4 m further, and 0.6 m


def test_pictures_without_truth_do_not_count():
    assert hits([0, 1], [None, 2.0], {0}).values["localisation"]["images"] == 1
    assert hits([0], [None], {0}) is None


def test_a_robot_may_be_kidnapped_again_and_again():
    stage, begun = PlacePrior(restart_after=3), []
    for index in range(7):
        begun.append(stage.step(Context("start"), tick(index), ROW).belief is not None)
    assert begun == [True, False, False, True, False, False, True]


@pytest.mark.parametrize(("at", "place"), [("truth", 2), ("origin", 0), ((5.5, 0.0, 0.0, 0.1, 0.1), 3)])
def test_a_start_is_the_place_closest_to_it(at, place):
    belief = PlacePrior(at=at).step(Context("start"), tick(0), ROW, Pose(4.4, 1.0, 0.0)).belief
    assert belief is not None
    assert belief.probabilities.tolist() == np.eye(4)[place].tolist()


def test_a_start_at_the_truth_needs_one():
    with pytest.raises(BadInput, match="start=uniform"):
        PlacePrior(at="truth").step(Context("start"), tick(0), ROW)


def test_figures_are_shares_and_medians_over_all_images():
    found = hits([0, 0, 1, 2, 3], [0.1, 0.1, 4.0, 4.25, 0.0], {0}).values["localisation"]
    # The believed medoids are 0.1, 0.1, 2, 0.25 and 6 m away, the nearest 0.1, 0.1, 0, 0.25 and 0.
    assert (found["images"], found["accuracy"], found["adjacent_accuracy"]) == (5, 3 / 5, 4 / 5)
    assert (found["place_distance_m"], found["nearest_place_distance_m"]) == pytest.approx((0.25, 0.1))
    assert found["adjacent_accuracy_after"] == [1.0, 1.0, 1.0]


def test_five_updates_are_told_and_half_a_metre_is_tolerated(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.undo()

    def tolerant(x: float) -> list[float | None]:
        drive = collected([tick(0)], [Pose(x, 0.0, 0.0)])
        out = PlaceAccuracy().step(Context("hits"), drive, [believed(0)], [believed(0)], ROW)
        return out.metrics.values["localisation"]["tolerant_accuracy_after"]

    assert tolerant(1.25) == [1.0, None, None, None, None]  # half a metre further than the next
    assert tolerant(1.3125) == [0.0, None, None, None, None]


def test_an_image_without_a_belief_is_an_update_that_does_not_count_and_odometry_is_no_truth():
    drive = collected([tick(k) for k in range(3)], [Pose(0.0, 0.0, 0.0)] * 3)
    beliefs = [believed(0), None, believed(1)]
    given = Context("hits"), drive, beliefs, [believed(0), None, None]
    found = PlaceAccuracy().step(*given, ROW).metrics.values["localisation"]
    assert found["accuracy_after"] == [1.0, None, 0.0]
    assert found["images"] == 2
    assert PlaceAccuracy().step(*given, dataclasses.replace(ROW, pose_source="odometry")).metrics is None


def test_places_beside_each_other_are_near_in_any_direction():
    corner = made_map([(0.0, 0.0), (0.0, 2.0), (2.0, 2.0)], {(0, 1): 0, (1, 2): 0})
    drive = collected([tick(k) for k in range(2)], [Pose(0.0, 1.9, 0.0), Pose(1.9, 1.9, 0.0)])
    beliefs = [PlaceBelief(np.eye(3)[place], corner.poses) for place in (2, 0)]
    found = PlaceAccuracy().step(Context("h"), drive, beliefs, beliefs, corner).metrics.values["localisation"]
    assert (found["accuracy"], found["adjacent_accuracy"]) == (0.0, 0.5)
    assert found["place_distance_m"] == pytest.approx((np.hypot(2.0, 0.1) + np.hypot(1.9, 1.9)) / 2)

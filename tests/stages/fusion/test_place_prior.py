"""The first belief over the places of a map."""

from dataclasses import replace

import numpy as np
import pytest
from made_places import made_map

from omninav.pipeline import Context, Tick
from omninav.pipeline.graph.problems import BadInput
from omninav.stages.fusion.place_prior import PlacePrior
from omninav.stages.values.commands import Reinitialise
from omninav.stages.values.pose import Pose

MAP = made_map([(0.0, 0.0), (4.0, 1.0), (4.0, 9.0)], {})


def begun(
    stage: PlacePrior,
    truth: Pose | None = None,
    index: int = 0,
    first: bool = True,
    restart: Reinitialise | None = None,
) -> list[float] | None:
    tick = Tick(index, index, first_of_log=first)
    belief = stage.step(Context("start"), tick, MAP, truth, restart).belief
    if belief is None:
        return None
    np.testing.assert_array_equal(belief.poses, MAP.poses[MAP.places])
    return belief.probabilities.tolist()


def test_a_kidnapped_robot_may_be_at_any_place() -> None:
    assert begun(PlacePrior()) == pytest.approx([1 / 3] * 3)


def test_a_known_start_is_the_place_whose_medoid_is_closest_in_both_directions() -> None:
    # (3, 6) is 3.2 m from (4, 9), 5.1 m from (4, 1) and 6.7 m from the origin.
    assert begun(PlacePrior(at="truth"), Pose(3.0, 6.0, 2.0)) == [0.0, 0.0, 1.0]
    assert begun(PlacePrior(at="origin"), Pose(3.0, 6.0, 2.0)) == [1.0, 0.0, 0.0]
    assert begun(PlacePrior(at=(5.0, 2.0, 0.0, 0.1, 0.1))) == [0.0, 1.0, 0.0]


def test_a_belief_begins_with_a_log_with_a_request_and_every_so_many_images() -> None:
    assert begun(PlacePrior(), index=7, first=False) is None
    trials = [begun(PlacePrior(restart_after=3), index=n, first=n == 0) is not None for n in range(7)]
    assert trials == [True, False, False, True, False, False, True]


def test_who_asks_to_start_again_says_where_or_means_anywhere() -> None:
    stage = PlacePrior(at="origin")
    at = Reinitialise((4.0, 8.0, 0.0, 0.1, 0.1))
    assert begun(stage, index=7, first=False, restart=at) == [0.0, 0.0, 1.0]
    assert begun(stage, index=7, first=False, restart=Reinitialise()) == pytest.approx([1 / 3] * 3)


def test_what_is_missing_is_said_in_one_line() -> None:
    with pytest.raises(BadInput, match="no true pose"):
        begun(PlacePrior(at="truth"))
    with pytest.raises(BadInput, match="no place"):
        PlacePrior().step(Context("start"), Tick(0, 0, first_of_log=True), replace(MAP, places=np.empty(0, np.int64)))


@pytest.mark.parametrize("place", [0, 1, 2, 3])
def test_the_origin_is_where_x_and_y_are_zero(place: int) -> None:
    # Four medoids around it, one of them a little nearer than the others.
    spots = [(0.6, 0.0), (-0.6, 0.0), (0.0, 0.6), (0.0, -0.6)]
    spots[place] = (0.9 * spots[place][0], 0.9 * spots[place][1])
    tick = Tick(0, 0, first_of_log=True)
    belief = PlacePrior(at="origin").step(Context("start"), tick, made_map(spots, {})).belief
    assert belief is not None
    assert belief.probabilities.argmax() == place

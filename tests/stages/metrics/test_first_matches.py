"""Right matches before the first wrong one, of made-up pictures whose points are known."""

from typing import Literal

import numpy as np
import pytest

from omninav.pipeline import Context
from omninav.pipeline.graph.problems import BadInput
from omninav.stages.metrics.first_matches import FirstMatches, pairs_apart, run_of_right
from omninav.stages.values.depths import Depths
from omninav.stages.values.local_features import LocalFeatures
from omninav.stages.values.pose import Pose

RNG = np.random.default_rng(5)
POINTS = RNG.uniform((-8.0, -8.0, -1.0), (8.0, 8.0, 2.0), (40, 3))
LOOKS = RNG.integers(0, 255, (40, 128)).astype(np.uint8)


def seen(x: float, swapped: bool = False) -> tuple[LocalFeatures, Depths]:
    """All points from x metres along the way; `swapped`: the last two look like each other's place."""
    away = POINTS - (x, 0.0, 0.0)
    metres = np.linalg.norm(away, axis=1)
    looks = LOOKS.copy()
    if swapped:
        looks[[-1, -2]] = looks[[-2, -1]]
        looks[:-2, 0] ^= 1  # so that the two are the clearest of all
    nothing = np.zeros((40, 2)), looks, np.zeros((40, 3), np.float32), np.ones(40, np.float32)
    return LocalFeatures(away / metres[:, None], *nothing), Depths(metres, np.zeros((0, 2)))


Search = Literal["both_ways", "one_way"]
Best = Literal["clearest", "nearest"]


def judged(swapped: bool, search: Search = "both_ways", best: Best = "clearest") -> dict[str, float]:
    poses = [Pose(x, 0.0, 0.0) for x in (0.0, 0.4, 1.0)]
    views = [seen(0.0), seen(0.4), seen(1.0, swapped)]
    stage = FirstMatches(apart_m=(1.0,), search=search, best=best)
    out = stage.step(Context("m"), poses, [view for view, _ in views], (), [depths for _, depths in views])
    return dict(out.metrics.values["matches"]["apart"][0])


@pytest.mark.parametrize("search", ["both_ways", "one_way"])
@pytest.mark.parametrize("best", ["clearest", "nearest"])
def test_without_a_wrong_match_all_are_counted(search: Search, best: Best) -> None:
    found = judged(False, search=search, best=best)
    assert (found["pairs"], found["first_right"], found["right"], found["right_share"]) == (1, 40.0, 40.0, 1.0)


def test_nothing_counts_behind_a_wrong_match() -> None:
    found = judged(True, best="nearest")
    assert (found["first_right"], found["right"]) == (0.0, 38.0)
    assert found["by_chance"] < 0.1


def test_a_run_ends_at_the_first_wrong_one() -> None:
    assert run_of_right(np.array([True, True, False, True])) == 2
    assert run_of_right(np.array([True, True])) == 2


def test_pairs_are_spread_over_the_log_and_as_far_apart_as_said() -> None:
    poses = np.column_stack([np.arange(100) * 0.3, np.zeros(100), np.zeros(100)])
    pairs = pairs_apart(poses, 2.0, 10)
    assert len(pairs) == 10
    assert {other - one for one, other in pairs} == {7}
    assert pairs[0][0] == 0
    assert pairs[-1][1] == 99
    assert pairs_apart(poses, 1000.0, 10) == []


def test_without_truth_nothing_can_be_said() -> None:
    with pytest.raises(BadInput, match="true pose"):
        FirstMatches().step(Context("m"), [None, None], [None, None])

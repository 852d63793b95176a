"""Where the pose that is stored with a view comes from."""

import numpy as np
import pytest
from made_references import references
from made_ticks import at_tick

from omninav.pipeline import Context
from omninav.pipeline.graph.problems import BadInput
from omninav.stages.mapping.pose_of_view import Supervised, pose_of_view
from omninav.stages.mapping.straightened_map import StraightenMap
from omninav.stages.values.maps import ReferenceGraph
from omninav.stages.values.pose import AssumedPose, Pose

VIEW = np.ones((1, 1), np.float32)
TRUE, DRIVEN = Pose(1.0, 2.0, 0.0), Pose(9.0, 9.0, 0.0)


def begun(supervised: Supervised = "auto", odometry: Pose | None = DRIVEN, truth: Pose | None = TRUE):
    map, ctx = ReferenceGraph.empty(), at_tick(first=True)
    return pose_of_view(ctx, odometry, truth, map, supervised), map.pose_source, ctx


@pytest.mark.parametrize(
    ("supervised", "truth", "pose", "source"),
    [
        ("auto", TRUE, TRUE, "truth"),
        ("auto", None, DRIVEN, "odometry"),
        ("odometry", TRUE, DRIVEN, "odometry"),
        ("truth", TRUE, TRUE, "truth"),
    ],
)
def test_the_first_view_settles_the_source(supervised: Supervised, truth: Pose | None, pose: Pose, source: str) -> None:
    found, settled, ctx = begun(supervised, truth=truth)
    assert (found, settled) == (pose, source)
    assert ctx.facts == {"map_poses": source}
    assert not ctx.counts


def test_a_guess_is_called_one_and_truth_that_is_asked_for_must_be_there() -> None:
    assert begun(odometry=AssumedPose(1.0, 0.0, 0.0), truth=None)[1] == "guess"
    with pytest.raises(BadInput, match="no ground truth for its first image"):
        begun("truth", truth=None)


@pytest.mark.parametrize(("source", "pose"), [("truth", TRUE), ("odometry", DRIVEN)])
def test_a_map_keeps_its_source_and_a_view_without_it_is_counted(source: str, pose: Pose) -> None:
    map, ctx = ReferenceGraph.empty(), at_tick()
    map.put(pose_source=source)
    map.insert(TRUE, VIEW, "histograms")
    assert pose_of_view(ctx, DRIVEN, TRUE, map, "auto") is pose
    lacking = {"odometry": DRIVEN, "truth": TRUE} | {source: None}
    assert pose_of_view(ctx, lacking["odometry"], lacking["truth"], map, "auto") is None
    assert ctx.counts == {"view_without_pose": 1}
    assert not ctx.facts


def test_truth_that_begins_after_the_first_view_is_told_once() -> None:
    map, ctx = ReferenceGraph.empty(), at_tick(first=True)
    for truth in (None, TRUE, TRUE):
        assert pose_of_view(ctx, DRIVEN, truth, map, "auto") is DRIVEN
        map.insert(DRIVEN, VIEW, "histograms")
    (told,) = ctx.warnings
    assert "the first image of the tour has no ground truth and later ones do" in told


@pytest.mark.parametrize("source", ["odometry", "guess"])
def test_frames_of_two_logs_are_not_mixed(source: str) -> None:
    map = ReferenceGraph.empty()
    map.put(pose_source=source)
    assert pose_of_view(at_tick(first=True, log=1), DRIVEN, None, map, "auto") is DRIVEN  # the first log had no view
    map.insert(TRUE, VIEW, "histograms")
    assert pose_of_view(at_tick(first=True, log=0), DRIVEN, None, map, "auto") is DRIVEN
    assert pose_of_view(at_tick(log=1), DRIVEN, None, map, "auto") is DRIVEN
    with pytest.raises(BadInput, match="a frame of its own"):
        pose_of_view(at_tick(first=True, log=1), DRIVEN, None, map, "auto")


def test_logs_with_ground_truth_go_into_one_map() -> None:
    map = ReferenceGraph.empty()
    map.put(pose_source="truth")
    map.insert(TRUE, VIEW, "histograms")
    assert pose_of_view(at_tick(first=True, log=1), DRIVEN, TRUE, map, "auto") is TRUE


@pytest.mark.parametrize(("views", "told"), [(1, ["has 1 view,"]), (5, ["has 5 views,"]), (6, [])])
def test_a_map_of_few_views_is_told(views: int, told: list[str]) -> None:
    map = references(np.zeros((views, 3)), np.ones((views, 1, 4), np.float32), source="truth")
    ctx = Context("straightened")
    StraightenMap().step(ctx, map, [])
    assert [words for line in ctx.warnings for words in told if words in line] == told
    assert len(ctx.warnings) == len(told)

"""Which images of a tour are compared, in which order, and what each pair is found to be."""

import functools
import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from made_places import made_map
from made_tour import Landmarks, along, scattered

from omninav.pipeline import Context, Tick
from omninav.pipeline.graph.contents import violation
from omninav.pipeline.graph.problems import BadInput
from omninav.stages.geometry.appearance.visual_distance import ComparisonOptions, compare
from omninav.stages.mapping.view_comparison import ViewComparison
from omninav.stages.values.compared_views import ComparedViews
from omninav.stages.values.local_features import GlobalDescriptor, LocalFeatures, VerticalSegments
from omninav.stages.values.pose import AssumedPose, Pose

WORLD = Landmarks(scattered(20.0, 20.0, 250))
POSES = along([(4.0, 10.0), (16.0, 10.0)], 1.5)[:6]
SEEN = [WORLD.seen(pose) for pose in POSES]
GREY = GlobalDescriptor(np.zeros(3, np.float32))
SECOND = 10**9


def stretch(azimuth: float) -> VerticalSegments:
    descriptors = np.full((1, 10), azimuth, np.float32)
    return VerticalSegments(
        np.array([azimuth]), np.zeros((1, 2)), descriptors, np.ones(1, np.float32), np.zeros((1, 2, 2))
    )


def compared(
    stamps: Sequence[float],
    logs: Sequence[int] | None = None,
    features: Sequence[LocalFeatures | None] = SEEN,
    ctx: Context | None = None,
    stage: ViewComparison | None = None,
    **ports: object,
) -> ComparedViews:
    """Views of images at these seconds."""
    number = len(stamps)
    logs = [0] * number if logs is None else logs
    ticks = [Tick(n, round(s * SECOND), log, n, n == 0) for n, (s, log) in enumerate(zip(stamps, logs, strict=True))]
    ports = {"descriptor": [GREY] * number, "odometry": POSES[:number], **ports}
    stage = ViewComparison() if stage is None else stage
    return stage.step(ctx or Context("views"), ticks, list(features[:number]), **ports).views  # type: ignore[arg-type]


def test_images_are_taken_where_enough_time_has_passed_with_a_tolerance_of_a_tenth() -> None:
    views = compared([0.0, 0.89, 0.9, 1.7, 2.0, 2.9])
    assert violation(views) is None
    assert views.frames.tolist() == [0, 2, 4, 5]
    assert np.diff(views.orders).tolist() == [1, 1, 1]
    assert views.poses.tolist() == [[POSES[n].x, POSES[n].y, POSES[n].heading] for n in (0, 2, 4, 5)]
    assert compared([0.0, 1.79, 1.8], stage=ViewComparison(every_s=2.0)).frames.tolist() == [0, 2]
    assert compared([0.0, 0.0, 0.1], stage=ViewComparison(every_s=0.0)).frames.tolist() == [0, 1, 2]


def test_each_tour_is_of_its_own_however_soon_it_follows() -> None:
    views = compared([0.0, 1.0, 1.1, 2.1], [0, 0, 1, 1])
    assert views.tours.tolist() == [1, 1, 2, 2]
    assert np.diff(views.orders).tolist() == [1, 1000, 1]
    assert views.owners.tolist() == [-1] * 4


def test_images_that_show_nothing_are_passed_over() -> None:
    some = [None, *SEEN[1:4]]
    views = compared(range(4), features=some, descriptor=[GREY, GREY, None, GREY])
    assert views.frames.tolist() == [1, 3]
    with pytest.raises(BadInput, match="use another tour"):
        compared(range(2), features=[None, None])


def test_images_of_a_robot_that_stands_are_passed_over_unless_it_turns() -> None:
    here, turned = POSES[0], replace(POSES[0], heading=POSES[0].heading + 0.1)
    near = replace(POSES[1], x=POSES[1].x + 0.01)
    driven = [here, here, turned, POSES[1], near, POSES[2]]
    assert compared(range(6), odometry=driven, truth=POSES).frames.tolist() == [0, 2, 3, 5]
    assert compared(range(6), odometry=(), truth=[here] * 6).frames.tolist() == [0, 1, 2, 3, 4, 5]
    assert compared(range(6), [0, 0, 1, 1, 1, 1], odometry=[here] * 6).frames.tolist() == [0, 2]
    assert len(compared(range(6), odometry=[AssumedPose(0.0, 0.0, 0.0)] * 6)) == 6  # a speed of 0 says nothing


def test_images_whose_true_pose_is_not_known_are_passed_over() -> None:
    views = compared(range(4), truth=[None, *POSES[1:3], None])
    assert violation(views) is None
    assert (views.pose_source, views.frames.tolist()) == ("truth", [1, 2])


def test_a_known_map_comes_first_and_is_counted_on_from() -> None:
    known = made_map([(0.0, 0.0), (4.0, 1.0)], {(0, 1): 1})  # frames 0, 10, 20 and orders 0, 1, 2
    views = compared(range(2), known=known, truth=POSES[:2])
    assert views.frames.tolist() == [0, 10, 20, 21, 22]
    assert views.orders.tolist() == [0, 1, 2, 1002, 1003]
    assert views.tours.tolist() == [0, 0, 0, 1, 1]
    assert views.owners.tolist() == [0, 1, 0, -1, -1]
    assert views.poses[:3].tolist() == known.poses.tolist()
    assert views.poses[3, :2].tolist() == [4.0, 10.0]


def test_every_two_views_are_compared_once_and_have_no_distance_to_themselves() -> None:
    views = compared(range(3))
    by = views.comparison_options()
    for one, other in ((0, 1), (0, 2), (1, 2)):
        found = compare(views.view_features(one), views.view_features(other), by)
        assert 0.0 < found.distance < math.inf
        assert views.distances[one, other] == views.distances[other, one] == found.distance
        share = found.matches / ((len(SEEN[one]) + len(SEEN[other])) / 2)
        assert views.shares[one, other] == views.shares[other, one] == pytest.approx(share)
        assert 0.0 < share < 1.0
    assert np.diagonal(views.distances).tolist() == [0.0] * 3
    assert np.diagonal(views.shares).tolist() == [1.0] * 3


def test_a_view_of_a_known_map_has_as_many_features_as_are_kept_of_it(monkeypatch: pytest.MonkeyPatch) -> None:
    # The map's views have one feature each, the tour's many; of one that matches none the share is 0 of 1.
    known = made_map([(0.0, 0.0), (4.0, 1.0)], {})
    few_matches = functools.partial(ComparisonOptions, min_matches=2)
    monkeypatch.setattr("omninav.stages.mapping.view_comparison.ComparisonOptions", few_matches)
    some = known.views.features(1).chosen(np.zeros(5, np.int64))
    some.descriptors[1:] = 255 - some.descriptors[1:]
    views = compared([0.0], features=[some], known=known, truth=POSES[:1], stage=ViewComparison())
    assert views.shares[1, 2] == 1.0  # not 1 of 3, the mean of 1 and 5
    assert views.shares[0, 2] == 0.0


def test_views_whose_colours_are_too_far_apart_are_not_compared() -> None:
    levels = [GlobalDescriptor(np.array([level, 0.0, 0.0], np.float32)) for level in (0.0, 0.5, -0.01)]
    views = compared(range(3), descriptor=levels)
    assert np.isfinite(views.distances).tolist() == [[True, True, True], [True, True, False], [True, False, True]]
    assert views.shares[1, 2] == 0.0
    assert [each.values[0] for each in views.descriptors] == pytest.approx([0.0, 0.5, -0.01])


def test_two_views_without_features_have_nothing_in_common() -> None:
    nothing = SEEN[0].chosen(np.arange(0))
    views = compared(range(2), features=[nothing, nothing])
    assert views.distances[0, 1] == math.inf
    assert views.shares[0, 1] == 0.0


def test_columns_belong_to_their_image_where_there_are_any() -> None:
    columns = [stretch(0.1), None, stretch(0.3)]
    views = compared(range(3), features=[replace(seen, columns=c) for seen, c in zip(SEEN, columns, strict=False)])
    found = [each.columns for each in views.features]
    assert [None if each is None else each.azimuths[0] for each in found] == [0.1, None, 0.3]


def test_views_say_by_what_they_were_compared() -> None:
    stage = ViewComparison(ratio=0.7)
    found = compared(range(2), stage=stage).comparison_options()
    assert found == ComparisonOptions(0.7)


@pytest.mark.parametrize(
    ("supervised", "odometry", "truth", "source"),
    [
        ("auto", POSES, POSES, "truth"),
        ("auto", POSES, (), "odometry"),
        ("auto", POSES, [None] * 6, "odometry"),
        ("auto", [None, AssumedPose(0.0, 0.0, 0.0), None], (), "guess"),
        ("odometry", POSES, POSES, "odometry"),
        ("truth", POSES, [None, *POSES[1:]], "truth"),
    ],
)
def test_poses_are_of_one_source_and_say_which(
    supervised: str, odometry: Sequence[Pose | None], truth: Sequence[Pose | None], source: str
) -> None:
    ctx = Context("views")
    stage = ViewComparison(supervised=supervised)  # type: ignore[arg-type]
    views = compared(range(3), ctx=ctx, stage=stage, odometry=odometry, truth=truth)
    assert views.pose_source == ctx.facts["map_poses"] == source
    given = [pose for pose in (truth if source == "truth" else odometry)[:3] if pose is not None]
    np.testing.assert_array_equal(views.poses, [[pose.x, pose.y, pose.heading] for pose in given])


def test_a_known_map_s_poses_and_the_tour_s_are_of_one_source() -> None:
    known = made_map([(0.0, 0.0)], {})
    with pytest.raises(BadInput, match="no frame in common"):
        compared(range(2), known=known)
    assert len(compared(range(2), known=known, truth=POSES[:2])) == 3
    with pytest.raises(BadInput, match="no ground truth"):
        compared(range(2), stage=ViewComparison(supervised="truth"), truth=[None, None])

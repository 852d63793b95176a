import numpy as np
import pytest

from omninav.pipeline import Context, Tick
from omninav.stages.mapping.reference_graph import LearnReferenceGraph, LearnReferenceGraphState
from omninav.stages.values.features import SegmentColours, SegmentHistograms
from omninav.stages.values.maps import ReferenceGraph
from omninav.stages.values.pose import Pose


def view(bin_: int, segments: int = 8) -> SegmentHistograms:
    values = np.zeros((segments, 20), np.float32)
    values[:, bin_] = 1.0
    return SegmentHistograms(values)


def drive(stage: LearnReferenceGraph, places: list[tuple[float, float, int]]) -> ReferenceGraph:
    ctx, along = Context("mapping"), LearnReferenceGraphState()
    map = ReferenceGraph.empty()
    for i, (x, y, looks) in enumerate(places):
        ctx.tick = Tick(index=i, stamp=i, first_of_log=i == 0)
        map = stage.step(ctx, view(looks), Pose(x + 100, y, 0.0), Pose(x, y, 0.0), map, along).map
    return map


def test_edges_follow_the_drive_and_close_loops_once() -> None:
    square = [(0.0, 0.0, 1), (1.0, 0.0, 1), (1.0, 1.0, 1), (0.0, 0.0, 1), (1.0, 0.0, 1)]
    map = drive(LearnReferenceGraph(distance_m=0.3, similarity=0.0), square)
    assert map.edges.tolist() == [[0, 1], [1, 2], [0, 2]]


def test_two_tours_are_not_joined_at_the_log_s_boundary() -> None:
    ctx, along, stage = Context("mapping"), LearnReferenceGraphState(), LearnReferenceGraph()
    map = ReferenceGraph.empty()
    for i, x in enumerate((0.0, 5.0)):
        ctx.tick = Tick(index=i, stamp=i, log=i, first_of_log=True)
        stage.step(ctx, view(1), None, Pose(x, 0.0, 0.0), map, along)
    assert len(map) == 2
    assert len(map.edges) == 0


def test_poses_come_from_where_the_map_says() -> None:
    map = drive(LearnReferenceGraph(supervised="odometry"), [(0.0, 0.0, 1)])
    assert (map.pose_source, map.poses[0, 0]) == ("odometry", 100.0)


def test_a_growing_map_keeps_what_it_had() -> None:
    map, rng = ReferenceGraph.empty(), np.random.default_rng(0)
    features = rng.random((300, 6, 3)).astype(np.float32)
    for i in range(300):
        assert map.insert(Pose(i, -i, 0.0), features[i], "colours") == i
        if i:
            assert map.join(i - 1, i)
    assert not map.join(5, 4)
    assert np.array_equal(map.features, features)
    assert np.array_equal(map.poses[:, 0], np.arange(300))
    assert len(map.edges) == 299


def test_views_of_another_kind_do_not_enter_a_map() -> None:
    map = ReferenceGraph.empty()
    map.insert(Pose(0, 0, 0), view(1).values, "histograms")
    with pytest.raises(ValueError, match="colours view"):
        map.insert(Pose(1, 0, 0), SegmentColours(np.zeros((8, 3), np.float32)).values, "colours")


def test_a_view_at_the_limits_adds_nothing() -> None:
    # As far as the distance, and as alike as asked: half of the bins are the same.
    stage, ctx = LearnReferenceGraph(distance_m=0.25, similarity=0.5), Context("mapping")
    along, map, reasons = LearnReferenceGraphState(), ReferenceGraph.empty(), []
    mixed = SegmentHistograms((view(3).values + view(7).values) / 2)
    unlike = SegmentHistograms((view(3).values + 2 * view(7).values) / 3)
    for tick, (seen, x) in enumerate(((view(3), 0.0), (mixed, 0.25), (unlike, 0.25), (view(7), 0.51))):
        ctx.tick = Tick(index=tick, stamp=tick, first_of_log=tick == 0)
        event = stage.step(ctx, seen, None, Pose(x, 0.0, 0.0), map, along).events
        reasons.append(None if event is None else (event.inserted, event.reason))
    assert reasons == [(0, "first"), None, (1, "unlike"), (2, "far")]
    assert map.edges.tolist() == [[0, 1], [1, 2]]


def test_a_view_is_compared_with_all_around_it_at_its_own_heading() -> None:
    # A half ring looks the same from a robot that is turned by half a turn, seen from the other side.
    ring = np.zeros((8, 20), np.float32)
    ring[:4, 3] = ring[4:, 7] = 1.0
    ctx, along, map = Context("mapping"), LearnReferenceGraphState(), ReferenceGraph.empty()
    stage = LearnReferenceGraph(distance_m=5.0, vicinity_m=5.0, similarity=0.9)
    seen = ((ring, 1.0), (np.roll(ring, 4, axis=0), 1.0 + np.pi), (ring, 1.0 + np.pi), (ring, 1.0 + 0.3 * np.pi / 4))
    for tick, (looks, heading) in enumerate(seen):
        ctx.tick = Tick(index=tick, stamp=tick, first_of_log=tick == 0)
        stage.step(ctx, SegmentHistograms(looks), None, Pose(0.01 * tick, 0.0, heading), map, along)
    assert map.poses[:, 0].tolist() == [0.0, 0.02]


def test_references_beyond_the_vicinity_do_not_count() -> None:
    places = [(0.0, 0.0, 3), (1.0, 0.0, 7), (0.6, 0.0, 3)]
    assert len(drive(LearnReferenceGraph(distance_m=0.45, vicinity_m=0.5, similarity=0.5), places)) == 3
    assert len(drive(LearnReferenceGraph(distance_m=0.45, vicinity_m=0.7, similarity=0.5), places)) == 2


def test_the_closest_reference_is_where_an_edge_leads_and_none_leads_across_a_gap() -> None:
    stage, ctx = LearnReferenceGraph(distance_m=0.4, similarity=0.0), Context("mapping")
    along, map = LearnReferenceGraphState(), ReferenceGraph.empty()
    for tick, x in enumerate((0.0, 1.0, 2.0, 3.0, None, 3.1, None, 0.9, 0.1)):
        ctx.tick = Tick(index=tick, stamp=tick, first_of_log=tick == 0)
        stage.step(ctx, view(3), None, None if x is None else Pose(x, 0.0, 0.0), map, along)
    assert map.edges.tolist() == [[0, 1], [1, 2], [2, 3]]
    assert along.reference == 0
    assert ctx.counts == {"view_without_pose": 2}


def test_of_several_references_around_a_view_belongs_to_the_closest() -> None:
    map = drive(LearnReferenceGraph(distance_m=0.4, similarity=0.0), [(x, 0.0, 3) for x in (0.0, 0.45, 2.0, 0.4)])
    assert map.poses[:, 0].tolist() == [0.0, 0.45, 2.0]
    assert map.edges.tolist() == [[0, 1], [1, 2]]

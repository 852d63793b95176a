import math
from pathlib import Path

import numpy as np
import pytest

from omninav.pipeline import Context, Tick
from omninav.pipeline.engine.artifact import write_artifact
from omninav.pipeline.graph.problems import BadInput
from omninav.stages.features.haar_integral import HaarIntegral
from omninav.stages.mapping.image_database import ImageDatabase, ImageDatabaseState
from omninav.stages.values.features import SegmentFeatures, SegmentHistograms
from omninav.stages.values.image import Panorama, Windows
from omninav.stages.values.maps import ReferenceGraph
from omninav.stages.values.pose import Pose

Tour = list[tuple[float, float, float]]


def views(segments: int, bins: int = 8, seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).random((segments, bins)).astype(np.float32) / bins


def learned(stage: ImageDatabase, tour: Tour, features: SegmentFeatures, odometry_only: bool = False) -> ReferenceGraph:
    ctx, map, last = Context("mapping"), ReferenceGraph.empty(), ImageDatabaseState()
    for number, pose in enumerate(tour):
        ctx.tick = Tick(number, number, first_of_log=number == 0)
        truth = None if odometry_only else Pose(*pose)
        map = stage.step(ctx, features, Pose(*pose), truth, map, last).map
    return map


STRAIGHT: Tour = [(0.1 * number, 0.0, 0.0) for number in range(21)]


def test_every_picture_is_a_reference_by_default_and_they_are_joined_in_order() -> None:
    map = learned(ImageDatabase(), STRAIGHT, SegmentHistograms(views(4)))
    assert np.allclose(map.poses, STRAIGHT)
    assert map.features.shape == (21, 4, 8)
    assert map.edges.tolist() == [[n, n + 1] for n in range(20)]
    assert map.pose_source == "truth"


def test_each_window_is_a_reference_that_looks_its_own_way() -> None:
    directions = np.array([0.0, math.pi / 2, math.pi, -math.pi / 2])
    tour: Tour = [(0.0, 0.0, 0.0), (1.0, 2.0, 3.0)]
    seen = SegmentHistograms(views(4), directions)
    map = learned(ImageDatabase(), tour, seen)
    assert map.features.shape == (8, 1, 8)
    assert np.array_equal(map.features[4:, 0], seen.values)
    assert np.allclose(map.poses[4:, :2], (1.0, 2.0))
    assert np.allclose(np.exp(1j * map.poses[4:, 2]), np.exp(1j * (3.0 + directions)))
    assert (np.abs(map.poses[:, 2]) <= math.pi).all()
    assert map.edges.tolist() == [[n, n + 4] for n in range(4)]


def test_poses_are_odometry_where_there_is_no_truth_unless_truth_is_asked_for() -> None:
    map = learned(ImageDatabase(), STRAIGHT, SegmentHistograms(views(4)), odometry_only=True)
    assert map.pose_source == "odometry"
    with pytest.raises(BadInput, match="no ground truth for its first image"):
        learned(ImageDatabase(supervised="truth"), STRAIGHT, SegmentHistograms(views(4)), odometry_only=True)


@pytest.mark.parametrize("kind", ["window", "panorama"])
def test_the_paper_s_936_images_take_at_most_4_megabytes(kind: str, tmp_path: Path) -> None:
    pixels = np.random.default_rng(1).integers(0, 256, (60, 80, 3), dtype=np.uint8)
    picture = Panorama(pixels) if kind == "panorama" else Windows(pixels[None], np.zeros(1), 1.0)
    features = HaarIntegral().step(Context("features"), picture).features
    map = learned(ImageDatabase(), [(0.0, 0.0, 0.0)] * 936, features)
    assert len(map) == 936
    write_artifact(tmp_path / "map.omap", map)
    assert (tmp_path / "map.omap").stat().st_size <= 4e6


def test_an_image_at_the_limit_itself_is_taken() -> None:
    tour: Tour = [(0.0, 0.0, 0.0), (0.3, 0.4, 0.0), (0.3, 0.4, 0.4), (0.3, 0.4, 0.6), (0.6, 0.4, 0.6)]
    seen = SegmentHistograms(views(4))

    def taken(**options: float) -> list[int]:
        map = learned(ImageDatabase(**options), tour, seen)
        return [tour.index(tuple(pose)) for pose in map.poses.tolist()]

    assert taken(min_distance_m=0.5) == [0, 1]
    assert taken(min_distance_m=0.51) == [0, 4]


def test_events_name_the_first_reference_of_each_image_and_tours_are_not_joined() -> None:
    ctx, map, last, stage = Context("mapping"), None, ImageDatabaseState(), ImageDatabase(min_distance_m=0.5)
    seen, events = SegmentHistograms(views(4), np.array([0.0, 1.0, 2.0, 3.0])), []
    for number, (x, first) in enumerate(((0.0, True), (0.1, False), (1.0, False), (1.1, True))):
        ctx.tick = Tick(number, number, first_of_log=first)
        out = stage.step(ctx, seen, None, Pose(x, 0.0, 0.0), map, last)
        map = out.map
        events.append(None if out.events is None else (out.events.inserted, out.events.reason))
    assert events == [(0, "first"), None, (4, "far"), (8, "far")]
    assert map is not None
    assert map.edges.tolist() == [[n, n + 4] for n in range(4)]


def test_an_image_without_a_pose_is_passed_over() -> None:
    ctx, map, last = Context("mapping"), ReferenceGraph.empty(), ImageDatabaseState()
    for number, truth in enumerate((Pose(0.0, 0.0, 0.0), None, Pose(2.0, 0.0, 0.0))):
        ctx.tick = Tick(number, number, first_of_log=number == 0)
        ImageDatabase().step(ctx, SegmentHistograms(views(4)), None, truth, map, last)
    assert map.poses[:, 0].tolist() == [0.0, 2.0]
    assert map.edges.tolist() == [[0, 1]]
    assert ctx.counts == {"view_without_pose": 1}

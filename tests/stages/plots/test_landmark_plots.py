"""Landmarks under a trajectory, and the features of an image that were taken for them."""

import math
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from landmark_tour import mapped_room
from small_run import reference_graph, small_run

from omninav.pipeline import Context, Tick
from omninav.stages.plots.camera_file import CameraFile
from omninav.stages.plots.drawing import shown_landmarks
from omninav.stages.plots.frame_by_frame import FrameByFrame
from omninav.stages.plots.landmark_matches import drawn_matches
from omninav.stages.plots.map_plan import MapPlot
from omninav.stages.plots.panorama_snapshot import EncodedPanorama, PanoramaSnapshot
from omninav.stages.plots.trajectory_over_map import TrajectoryOverMap
from omninav.stages.values.image import Panorama, Windows
from omninav.stages.values.landmarks import LandmarkFix
from omninav.stages.values.thumbnails import decoded

CTX = Context("view")
AHEAD, LEFT, BEHIND, ABOVE = [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [-1.0, -1e-6, 0.0], [0.0, 0.0, 1.0]


def fix_of(bearings: list[list[float]], agree: list[int]) -> LandmarkFix:
    return LandmarkFix(
        np.zeros((1, 3)), np.eye(3)[None], np.array([agree.count(0)]), np.array([0.9]), len(agree),
        np.array(bearings, np.float32), np.array(agree, np.int8),
    )  # fmt: skip


def snapshot(fix: LandmarkFix | None, columns: int = 360) -> EncodedPanorama:
    panorama = Panorama(np.full((columns // 4, columns, 3), 127, np.uint8), math.pi / 8, -math.pi / 8)
    found = PanoramaSnapshot().step(CTX, Tick(0, 0), panorama, fix).snapshot
    assert found is not None
    return found


@pytest.mark.parametrize("columns", [360, 960])  # the larger one is kept at half its size
def test_matched_features_are_where_the_panorama_shows_them(columns: int) -> None:
    found = snapshot(fix_of([AHEAD, LEFT, BEHIND, ABOVE], [0, -1, 1, 0]), columns)
    kept = min(columns, 480)
    assert found.points[:3] == pytest.approx(
        np.array([[kept / 2, kept / 8], [kept / 4, kept / 8], [kept, kept / 8]]) - 0.5, abs=0.6
    )
    assert np.isnan(found.points[3]).all()
    assert found.agree.tolist() == [True, False, False, True]


def test_features_that_agree_are_green_and_the_others_orange() -> None:
    found = snapshot(fix_of([AHEAD, LEFT, ABOVE], [0, -1, 0]))
    pixels = decoded(drawn_matches(found)).astype(int)
    blue, green, red = pixels[45, 180]
    assert green > red + 50
    blue, green, red = pixels[45, 90]
    assert red > green + 50
    assert red > blue + 50
    assert np.abs(pixels[45, 270] - 127).max() < 10


def test_an_image_without_a_fix_stays_as_it_is() -> None:
    plain = snapshot(None)
    assert plain.points is None
    assert drawn_matches(plain) == plain.jpeg
    bare = replace(fix_of([AHEAD], [0]), bearings=None, agree=None)
    assert snapshot(bare).points is None
    windows = Windows(np.zeros((2, 8, 8, 3), np.uint8), np.array([0.0, 1.0]), 0.5)
    assert PanoramaSnapshot().step(CTX, Tick(0, 0), windows, fix_of([AHEAD], [0])).snapshot.points is None


def test_a_slide_says_how_many_matches_agree() -> None:
    run = small_run(frames=3)
    found = snapshot(fix_of([AHEAD, LEFT, BEHIND], [0, -1, 0]))
    plot = FrameByFrame().step(CTX, run.drive, [found] * 3, run.beliefs, run.map).plot
    assert ("landmarks", "2 of 3 matches agree") in plot.slides[0].facts
    assert dict(plot.slides[0].photographs)["image"] != found.jpeg
    assert "green where they agree" in plot.caption
    plain = FrameByFrame().step(CTX, run.drive, [snapshot(None)] * 3, run.beliefs, run.map).plot
    assert "landmarks" not in dict(plain.slides[0].facts)
    assert "green where they agree" not in plain.caption


def test_landmarks_lie_under_the_trajectory_and_under_the_map() -> None:
    run = small_run(frames=6)
    map = mapped_room()
    for plot in (TrajectoryOverMap(), MapPlot()):
        plain, drawn = (plot.step(CTX, run.drive, each).plot.content for each in (reference_graph(6), map))
        assert b"<image" not in plain
        assert f"landmarks ({len(map.landmarks)})".encode() in drawn
        assert drawn.count(b"<image") == 1
        assert len(drawn) < len(plain) + 60_000
        assert drawn.index(b"<image") < drawn.index(b"stroke-linecap:round")


def test_a_landmark_far_from_all_others_does_not_shrink_the_plot() -> None:
    landmarks = mapped_room().landmarks
    points = landmarks.points.copy()
    points[5] = [900.0, -900.0, 0.0]
    shown = shown_landmarks(replace(landmarks, points=points))
    assert len(landmarks) * 0.95 < len(shown) < len(landmarks)
    assert np.abs(shown).max() < 20.0
    assert shown_landmarks(landmarks.of_references(np.empty(0, np.int64))).shape == (0, 2)


def test_a_drawn_image_is_hardly_larger() -> None:
    pixels = cv2.GaussianBlur(np.random.default_rng(0).integers(0, 255, (80, 360, 3)).astype(np.uint8), (0, 0), 2)
    jpeg = cv2.imencode(".jpg", pixels, [cv2.IMWRITE_JPEG_QUALITY, 80])[1].tobytes()
    points = np.random.default_rng(1).uniform([0, 0], [360, 80], (100, 2)).astype(np.float32)
    drawn = drawn_matches(EncodedPanorama(jpeg, (), points, np.arange(100) % 3 > 0))
    assert len(drawn) < len(jpeg) + 5000


def test_the_camera_that_landmarks_ask_for_is_written_and_nothing_where_they_ask_for_none(tmp_path: Path) -> None:
    map, ctx = mapped_room(), Context("camera_file", folder=tmp_path)
    for each in (map, replace(map, landmarks=None)):
        CameraFile().step(ctx, each)
        assert not list(tmp_path.iterdir())
    CameraFile().step(ctx, replace(map, landmarks=replace(map.landmarks, camera="projection: donut\n")))
    assert (tmp_path / "camera.yaml").read_text() == "projection: donut\n"

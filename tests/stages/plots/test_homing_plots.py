"""Homing is shown frame by frame."""

import dataclasses
import math
import re

import numpy as np
import pytest
from made_places import made_map
from measured_drives import made_drive

from omninav.pipeline import Context, Tick
from omninav.pipeline.engine.codec import decode, encode
from omninav.stages.camera.equirectangular import Equirectangular
from omninav.stages.camera.hyperbolic import HyperbolicMirror
from omninav.stages.plots.frame_by_frame import FrameByFrame
from omninav.stages.plots.homing_frames import draw_vector
from omninav.stages.plots.homing_snapshot import HomingSnapshot
from omninav.stages.plots.plan_chart import plan_chart
from omninav.stages.plots.target_images import FirstThumbnail, image_of, target_view
from omninav.stages.plots.thumbnails import joined
from omninav.stages.values.floor_plan import FloorPlan
from omninav.stages.values.homing import DrivingStatus, HomingTarget, HomingVector, PathProgress, TrackedFeatures
from omninav.stages.values.image import Image
from omninav.stages.values.local_features import LocalFeatures
from omninav.stages.values.planned_route import PlannedRoute
from omninav.stages.values.thumbnails import decoded

CTX = Context("view")
MIRROR = HyperbolicMirror(640, 480, 497.0, 497.0, 319.5, 239.5, 28.095, 23.4125, 34.0, 238.0, height=0.9, yaw=0.3)
STRIP = Equirectangular(360, 90, 180.0, elevation_top=0.7, elevation_bottom=-0.85, height=0.9)
MAP = made_map([(1.0, 1.0), (4.0, 1.0), (4.0, 4.0)], {(0, 1): 1, (1, 2): 0})
PLAN = FloorPlan(np.array([[(2.0, 2.0), (3.0, 2.0), (3.0, 3.0), (2.0, 3.0)]]), 6.0, 5.0)
TICKS = 12


def target(number: int) -> HomingTarget:
    around = np.linspace(-3.0, 3.0, 9)
    bearings = np.stack([np.cos(around), np.sin(around), np.full(9, -0.2)], axis=-1)
    features = LocalFeatures(
        bearings / np.linalg.norm(bearings, axis=1)[:, None],
        np.full((9, 2), np.nan),
        np.zeros((9, 128), np.uint8),
        np.zeros((9, 3), np.float32),
        np.ones(9, np.float32),
    )
    return HomingTarget(number, features, name=f"place {number}")


def vector(tick: int, lost: bool) -> HomingVector:
    metres = 2.5 - 0.2 * tick
    return HomingVector(0, 0.4, 0.1, 0.5, 0.5, 0.2, metres, 0 if lost else 5, "lost" if lost else "tracking")


def snapshots(camera: HyperbolicMirror | Equirectangular) -> list:
    """A drive of two seconds; at tick 0 there is no target yet, at tick 7 it is lost."""
    rng = np.random.default_rng(0)
    looks = [rng.integers(0, 255, (camera.height_px // 30, camera.width // 30, 3)).astype(np.uint8) for _ in range(2)]
    stage, found = HomingSnapshot(), []
    for k in range(TICKS):
        pixels = np.roll(looks[0].repeat(30, axis=0).repeat(30, axis=1), 3 * k, axis=1)
        kinds = np.array([1, 1, 2, 3, 0, 1])
        points = np.column_stack([np.linspace(0.3, 0.7, 6) * camera.width, np.full(6, 0.3 * camera.height_px)])
        tracks = TrackedFeatures(1, np.arange(6), kinds, points, np.zeros((6, 3)), np.zeros((6, 3)))
        followed = (target(1), vector(k, k == 7), None if k == 7 else tracks) if k > 0 else ()
        tick = Tick(k, k * 200_000_000, 0, k, k == 0)
        found.append(stage.step(CTX, tick, Image(pixels), camera, *followed).snapshot)
    return found


def drive(camera: HyperbolicMirror | Equirectangular = MIRROR) -> dict:
    way, over = (PlannedRoute(np.array([0, 1, 2]), state, 0) for state in ("under way", "arrived"))
    return {
        "drive": made_drive([(1.0 + 0.2 * k, 1.1, 0.1 * k) for k in range(TICKS)], every_s=0.2),
        "homing": snapshots(camera),
        "statuses": [DrivingStatus("driving")] * TICKS,
        "progress": [None if k == 0 else PathProgress(0, 1, 4, 1, False, False, False) for k in range(TICKS)],
        "routes": [way] * 10 + [over] * 2,
        "map": MAP,
        "plan": PLAN,
    }


@pytest.mark.parametrize("camera", [MIRROR, STRIP], ids=["mirror", "strip"])
def test_a_frame_shows_what_is_followed_the_target_and_the_vector(camera):
    given = drive(camera)
    one, other = (FrameByFrame().step(CTX, snapshots=[None] * TICKS, **given).plot for _ in range(2))
    assert encode(one) == encode(other)
    first, followed, lost, *_ = (one.slides[n] for n in (0, 3, 7))
    assert [caption for caption, _ in first.photographs] == ["image"]
    assert [caption for caption, _ in followed.photographs] == ["image", "target: place 1"]
    seen, target_view = (decoded(jpeg).astype(int) for _, jpeg in followed.photographs)
    plain = decoded(given["homing"][3].jpeg).astype(int)
    assert np.abs(seen - plain).max() > 60  # features and the vector are drawn into the image
    assert target_view.shape == seen.shape
    facts = dict(followed.facts)
    assert facts["homing vector"] == "1.90 m, turn 6°"
    assert facts["features"] == "5 agree, 1 of 6 lost"
    assert facts["path"] == "view 2 of 4"
    assert facts["robot"] == "driving"
    assert dict(lost.facts)["homing vector"] == "the target is lost"
    assert "--orange" in followed.overlay
    assert "--green" in followed.overlay  # the route


def test_the_vector_is_drawn_from_the_robot_as_long_as_it_is_known_and_dashed_where_it_is_not():
    def drawn(vector_: HomingVector) -> list[float]:
        chart = plan_chart((0.0, 10.0, 0.0, 10.0))
        layer = chart.layer()
        draw_vector(layer, np.array([2.0, 3.0, math.pi / 2]), vector_, np.full(3, np.nan))
        (mark,) = layer.marks
        marks.append(mark)
        x0, y0, x1, y1 = map(float, re.findall(r"-?\d+\.\d", mark)[:4])
        unit = chart.x.per_unit
        return [(x1 - x0) / unit, (y0 - y1) / unit]

    marks: list[str] = []
    known = HomingVector(0, 0.0, 0.1, 0.5, 0.5, 0.2, 4.0, 5, "tracking")
    assert drawn(known) == pytest.approx([0.0, 4.0], abs=0.01)  # the robot looks up the page
    assert drawn(dataclasses.replace(known, metres=None, direction=-math.pi / 2)) == pytest.approx([1.0, 0.0], abs=0.01)
    assert ["dasharray" in mark for mark in marks] == [False, True]


def test_a_snapshot_is_of_the_mirrors_disc_and_its_points_move_with_it():
    snapshot = snapshots(MIRROR)[1]
    assert snapshot.size == (478, 478)  # of 640 x 480
    assert decoded(snapshot.jpeg).shape == (478, 478, 3)
    middle = np.array([319.5, 239.5]) - (81, 1) + 0.0  # the disc begins at column 81, row 1
    assert middle == pytest.approx((238.5, 238.5), abs=0.5)
    way = snapshot.floor_line[np.isfinite(snapshot.floor_line).all(axis=1)]
    towards = np.arctan2(*(way[-1] - middle)[::-1])  # in the picture an azimuth turns by the camera's yaw
    assert towards == pytest.approx(0.4 - 0.3, abs=0.02)
    assert snapshot.target_kinds.tolist() == [1, 1, 2, 3, 0, 1, -1, -1, -1]
    assert encode(decode(encode(snapshot))) == encode(snapshot)


def test_the_target_is_the_view_that_the_way_has_come_to():
    way = PlannedRoute(np.array([2, 1, 0]), "under way", 3)  # back: place 2, place 1, the path image, place 0
    views = [target_view(PathProgress(3, at, 4, 0, False, False, False), way, MAP) for at in range(5)]
    assert views == [2, 1, 3, 0, 0]
    assert target_view(PathProgress(2, 0, 4, 0, False, False, False), way, MAP) is None  # of an older way
    assert target_view(PathProgress(2, 0, 1, 0, True, False, False), None, None) == 0


def test_a_view_has_an_image_where_there_is_a_thumbnail_of_it():
    thumbnails = joined([b"", snapshots(STRIP)[0].jpeg])
    assert (image_of(1, thumbnails) == thumbnails.image(1)).all()
    assert [image_of(view, thumbnails) for view in (None, 0, 2)] == [None] * 3
    assert image_of(1, None) is None


def test_the_first_image_of_a_run_is_the_only_thumbnail():
    seen = snapshots(STRIP)
    thumbnails = FirstThumbnail().step(CTX, seen).thumbnails
    assert (thumbnails.image(0) == decoded(seen[0].jpeg)).all()
    assert FirstThumbnail().step(CTX, []).thumbnails is None

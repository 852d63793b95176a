"""What homing follows, as images and as a video."""

import cv2
import numpy as np
import pytest
from made_places import made_map
from small_run import collected

from omninav.pipeline import Context, Tick
from omninav.pipeline.engine.codec import decode, encode
from omninav.stages.camera.equirectangular import Equirectangular
from omninav.stages.camera.hyperbolic import HyperbolicMirror
from omninav.stages.mapping.thumbnails import TourSnapshot, ViewThumbnails, joined
from omninav.stages.plots.drive_video import DriveVideo
from omninav.stages.plots.homing_snapshot import HomingSnapshot, HomingSnapshotState
from omninav.stages.plots.homing_snapshots import HomingSnapshots
from omninav.stages.plots.target_images import FirstThumbnail, image_of, target_view
from omninav.stages.plots.video import gif, mp4
from omninav.stages.values.belief import PlaceBelief
from omninav.stages.values.floor_plan import FloorPlan
from omninav.stages.values.homing import DrivingStatus, HomingTarget, HomingVector, PathProgress, TrackedFeatures
from omninav.stages.values.image import Image
from omninav.stages.values.local_features import LocalFeatures
from omninav.stages.values.planned_route import PlannedRoute
from omninav.stages.values.pose import Pose
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


def snapshots(camera: HyperbolicMirror | Equirectangular, every_s: float = 0.0) -> list:
    """A drive of two seconds; at tick 0 there is no target yet, at tick 7 it is lost."""
    rng = np.random.default_rng(0)
    looks = [rng.integers(0, 255, (camera.height_px // 30, camera.width // 30, 3)).astype(np.uint8) for _ in range(2)]
    stage, looked, found = HomingSnapshot(every_s=every_s, columns=240), HomingSnapshotState(), []
    for k in range(TICKS):
        pixels = np.roll(looks[0].repeat(30, axis=0).repeat(30, axis=1), 3 * k, axis=1)
        kinds = np.array([1, 1, 2, 3, 0, 1])
        points = np.column_stack([np.linspace(0.3, 0.7, 6) * camera.width, np.full(6, 0.3 * camera.height_px)])
        known = k > 0
        nowhere = np.zeros((6, 3))
        found.append(
            stage.step(
                CTX,
                looked,
                Tick(k, k * 200_000_000, 0, k, k == 0),
                Image(pixels),
                camera,
                target(1) if known else None,
                vector(k, k == 7) if known else None,
                TrackedFeatures(1, np.arange(6), kinds, points, nowhere, nowhere) if known and k != 7 else None,
            ).snapshot
        )
    return found


def drive(camera: HyperbolicMirror | Equirectangular = MIRROR) -> dict:
    way = PlannedRoute(np.array([0, 1, 2]), "under way", 0)
    over = PlannedRoute(np.array([0, 1, 2]), "arrived", 0)
    return {
        "drive": collected(
            [Tick(k, k * 200_000_000, 0, k, k == 0) for k in range(TICKS)],
            [Pose(1.0 + 0.2 * k, 1.1, 0.1 * k) for k in range(TICKS)],
        ),
        "snapshots": snapshots(camera),
        "progress": [None if k == 0 else PathProgress(0, 1, 4, 1, False, False, False) for k in range(TICKS)],
        "routes": [way] * 10 + [over] * 2,
        "map": MAP,
        "plan": PLAN,
    }


def video_of(ctx: Context = CTX) -> DriveVideo.Out:
    beliefs = [PlaceBelief(np.array([0.7, 0.2, 0.1]), np.zeros((3, 3)))] * TICKS
    return DriveVideo(after_s=0.1).step(ctx, statuses=[DrivingStatus("driving")] * TICKS, beliefs=beliefs, **drive())


def frames_in(content: bytes, path) -> list:
    path.write_bytes(content)
    video, found = cv2.VideoCapture(str(path)), []
    while (read := video.read())[0]:
        found.append(read[1])
    return found


@pytest.mark.parametrize("camera", [MIRROR, STRIP], ids=["mirror", "strip"])
def test_rows_are_drawn_the_same_every_time_for_every_camera(camera):
    one, other = (HomingSnapshots().step(CTX, **drive(camera)).figure for _ in range(2))
    assert one.content == other.content
    pixels = cv2.imdecode(np.frombuffer(one.content, np.uint8), cv2.IMREAD_COLOR)
    assert pixels.std() > 20
    assert len(one.content) < 600_000


def test_a_snapshot_is_of_the_mirrors_disc_and_its_points_move_with_it():
    snapshot = snapshots(MIRROR)[1]
    assert snapshot.size == (240, 240)  # of 640 x 480
    assert decoded(snapshot.jpeg).shape == (240, 240, 3)
    middle = (np.array([319.5, 239.5]) - (81, 1) + 0.5) * 240 / 478 - 0.5  # the disc begins at column 81, row 1
    assert middle == pytest.approx((119.5, 119.5), abs=0.5)
    way = snapshot.floor_line[np.isfinite(snapshot.floor_line).all(axis=1)]
    towards = np.arctan2(*(way[-1] - middle)[::-1])  # in the picture an azimuth turns by the camera's yaw
    assert towards == pytest.approx(0.4 - 0.3, abs=0.02)
    assert snapshot.target_kinds.tolist() == [1, 1, 2, 3, 0, 1, -1, -1, -1]
    assert encode(decode(encode(snapshot))) == encode(snapshot)


def test_between_snapshots_nothing_is_kept():
    given = [snapshot is not None for snapshot in snapshots(STRIP, every_s=0.5)]
    assert given == [k % 3 == 0 for k in range(TICKS)]  # ticks are 0.2 s apart: 0.6 s is the next


def test_a_video_is_written_whole_the_same_every_time_and_ends_with_the_drive(tmp_path):
    ctx = Context("video", folder=tmp_path)
    one, other = video_of(ctx=ctx).figure, video_of().figure
    assert one.content == other.content == (tmp_path / "drive.mp4").read_bytes()
    assert [path.name for path in tmp_path.iterdir()] == ["drive.mp4"]
    assert one.media_type == "video/mp4"
    frames = frames_in(one.content, tmp_path / "again.mp4")
    assert len(frames) == 11  # it arrives at tick 10, and 0.1 s later is before the next
    assert np.abs(frames[3].astype(int) - frames[8]).mean() > 2
    assert len(one.content) < 400_000
    assert "11 frames" in one.caption


def test_a_video_has_no_more_frames_than_it_may(tmp_path):
    given = drive() | {"statuses": [None] * TICKS}
    video = DriveVideo(frames=4).step(CTX, **given).figure
    assert len(frames_in(video.content, tmp_path / "few.mp4")) == 4


def test_without_an_encoder_a_video_is_an_animated_image(tmp_path, monkeypatch):
    monkeypatch.setattr("omninav.stages.plots.video.mp4", lambda frames, per_second: None)
    ctx = Context("video", folder=tmp_path)
    figure = video_of(ctx=ctx).figure
    assert figure.media_type == "image/gif"
    assert (tmp_path / "drive.gif").read_bytes() == figure.content == video_of().figure.content
    assert figure.content.startswith(b"GIF89a")


def test_both_kinds_of_video_hold_the_frames_in_their_order(tmp_path):
    frames = [np.full((64, 96, 3), shade, np.uint8) for shade in (20, 120, 220)]
    for made, name in ((mp4(frames, 5.0), "a.mp4"), (gif(frames, 5.0), "a.gif")):
        shades = [frame.mean() for frame in frames_in(made.content, tmp_path / name)]
        assert shades == pytest.approx([20, 120, 220], abs=6)


def test_the_target_is_the_view_that_the_way_has_come_to():
    way = PlannedRoute(np.array([2, 1, 0]), "under way", 3)  # back: place 2, place 1, the path image, place 0
    views = [target_view(PathProgress(3, at, 4, 0, False, False, False), way, MAP) for at in range(5)]
    assert views == [2, 1, 3, 0, 0]
    assert target_view(PathProgress(2, 0, 4, 0, False, False, False), way, MAP) is None  # of an older way
    assert target_view(PathProgress(2, 0, 1, 0, True, False, False), None, None) == 0


def test_thumbnails_are_of_the_maps_views_and_not_of_a_known_maps():
    images = []
    for shade in range(40):  # the map's views are every tenth picture of the tour
        pixels = np.full((48, 64, 3), 6 * shade, np.uint8)
        images.append(TourSnapshot(columns=32).step(CTX, Image(pixels)).snapshots)
    ticks = [Tick(k, k) for k in range(40)]
    thumbnails = ViewThumbnails().step(CTX, ticks, images, MAP).thumbnails
    assert [round(image_of(view, thumbnails).mean() / 60) for view in range(4)] == [0, 1, 2, 3]
    grown = (
        ViewThumbnails().step(CTX, ticks, images, MAP, known=made_map([(0.0, 0.0), (1.0, 0.0)], {(0, 1): 0})).thumbnails
    )
    assert [image_of(view, grown) is None for view in range(4)] == [True, True, False, False]
    assert image_of(2, grown).mean() == pytest.approx(6 * (20 - 11), abs=2)
    assert image_of(None, thumbnails) is None
    assert image_of(9, joined([])) is None


def test_the_first_image_of_a_run_is_the_only_thumbnail():
    seen = snapshots(STRIP)
    thumbnails = FirstThumbnail().step(CTX, seen).thumbnails
    assert (thumbnails.image(0) == decoded(seen[0].jpeg)).all()
    assert FirstThumbnail().step(CTX, []).thumbnails is None

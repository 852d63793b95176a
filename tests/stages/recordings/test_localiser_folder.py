"""The folder that a localiser of one's own is given."""

import csv
import dataclasses
from pathlib import Path

import cv2
import numpy as np
import pytest

from omninav.pipeline import BadInput
from omninav.stages.recordings.camera_yaml import read_camera, write_camera
from omninav.stages.recordings.localiser_folder import read_poses, write_folder
from omninav.stages.recordings.recorded_images import RecordedImages

CAMERA = read_camera(Path(__file__).resolve().parents[2] / "data" / "camera.yaml")


def recorded(*pictures: np.ndarray, odometry: np.ndarray, truth: np.ndarray) -> RecordedImages:
    pngs = [cv2.imencode(".png", picture)[1].tobytes() for picture in pictures]
    stamps = 1_700_000_000_000_000_001 + 10**8 * np.arange(len(pngs))
    ends = np.cumsum([0, *map(len, pngs)])
    return RecordedImages(write_camera(CAMERA), np.frombuffer(b"".join(pngs), np.uint8), ends, stamps, odometry, truth)


def test_images_are_without_loss_times_exact_and_what_is_not_known_is_left_out_or_empty(tmp_path: Path):
    rng = np.random.default_rng(0)
    pictures = rng.integers(0, 255, (3, CAMERA.height_px, CAMERA.width, 3), np.uint8)
    poses = np.array([[1.0, 2.0, 0.1], [np.nan] * 3, [3.0, 4.0, -0.2]])
    images = recorded(*pictures, odometry=poses, truth=poses)
    files = write_folder(tmp_path, images, images)
    assert sorted(files) == sorted(path for path in tmp_path.rglob("*") if path.is_file())
    mapped, driven = (list(csv.DictReader((tmp_path / each / "images.csv").open())) for each in ("map", "drive"))
    assert [row["x"] for row in mapped] == ["1.000000000", "3.000000000"]
    assert [row["odometry_heading"] for row in driven] == ["0.100000000", "", "-0.200000000"]
    assert [row["time"] for row in mapped] == ["1700000000.000000001", "1700000000.200000001"]
    assert (cv2.imread(str(tmp_path / "map" / mapped[1]["file"])) == pictures[2]).all()
    assert (tmp_path / "camera.yaml").read_text() == write_camera(CAMERA)


def test_a_pixels_ray_is_where_the_camera_looks(tmp_path: Path):
    picture = np.zeros((CAMERA.height_px, CAMERA.width, 3), np.uint8)
    images = recorded(picture, odometry=np.zeros((1, 3)), truth=np.zeros((1, 3)))
    write_folder(tmp_path, images, images)
    rays = np.load(tmp_path / "rays.npy")
    assert rays.shape == picture.shape
    ahead = np.array([np.cos(0.3), np.sin(0.3), 0.0])
    (u, v), seen = CAMERA.project(ahead)
    assert seen
    assert rays[round(float(v)), round(float(u))] == pytest.approx(ahead, abs=0.03)
    assert np.isnan(rays[0, 0]).all()


def test_a_map_of_another_camera_is_refused(tmp_path: Path):
    picture = np.zeros((CAMERA.height_px, CAMERA.width, 3), np.uint8)
    images = recorded(picture, odometry=np.zeros((1, 3)), truth=np.zeros((1, 3)))
    other = dataclasses.replace(images, camera=images.camera.replace(str(CAMERA.width), str(CAMERA.width + 2), 1))
    with pytest.raises(BadInput, match="are of two cameras"):
        write_folder(tmp_path, other, images)


def test_a_pose_is_that_of_the_nearest_image(tmp_path: Path):
    picture = np.zeros((CAMERA.height_px, CAMERA.width, 3), np.uint8)
    images = recorded(*[picture] * 4, odometry=np.zeros((4, 3)), truth=np.zeros((4, 3)))
    early, late = (images.stamps[[0, 2, 3]] + shift for shift in (-900_000, 900_000))
    for times in (early, late):
        rows = [f"{stamp // 10**9}.{stamp % 10**9:09d},{stamp % 7},0,0" for stamp in times.tolist()]
        (tmp_path / "poses.csv").write_text("\n".join(["time,x,y,heading", *rows]))
        poses, _ = read_poses(tmp_path, images)
        assert poses[:, 0] == pytest.approx([times[0] % 7, np.nan, times[1] % 7, times[2] % 7], nan_ok=True)

"""Cameras from images of a checkerboard, rendered through cameras that are known."""

from pathlib import Path

import cv2
import numpy as np
import pytest
from made_boards import COLUMNS, MIRROR, ROWS, boards, worst_deg

from omninav.pipeline import BadInput, Context
from omninav.stages.camera.model import Camera
from omninav.stages.recordings.camera_yaml import read_camera
from omninav.stages.tools.camera_calibrate import CalibrateCamera
from omninav.stages.tools.camera_look import LookThroughCamera


def rendered(camera: Camera, rotation: np.ndarray, place: np.ndarray) -> np.ndarray:
    """A grey world with a checkerboard in it, four rays a pixel."""
    image = np.zeros((480, 640))
    for shift in ((-0.25, -0.25), (-0.25, 0.25), (0.25, -0.25), (0.25, 0.25)):
        rays, looks = camera.unproject(camera.grid() + shift)
        on_board = np.nan_to_num(rays) @ rotation
        with np.errstate(divide="ignore", invalid="ignore"):
            distance = (rotation.T @ place)[2] / on_board[..., 2]
            x, y = np.moveaxis(on_board[..., :2] * distance[..., None] - (rotation.T @ place)[:2], -1, 0)
            margin = (x > -1.6) & (x < COLUMNS + 0.6) & (y > -1.6) & (y < ROWS + 0.6) & (distance > 0)
            squares = (x > -1) & (x < COLUMNS) & (y > -1) & (y < ROWS)
            dark = squares & ((np.floor(x) + np.floor(y)) % 2 == 0)
        image += np.where(looks, np.where(margin, np.where(dark, 20, 235), 110), 0) / 4
    return image.astype(np.uint8)


def test_images_of_a_board_make_a_camera_file_and_a_picture(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "images").mkdir()
    for number, (rotation, place) in enumerate(boards(-0.1)):
        cv2.imwrite(str(tmp_path / "images" / f"{number}.png"), rendered(MIRROR, rotation, place))
    cv2.imwrite(
        str(tmp_path / "images" / "6.png"), np.full((480, 640), 90, np.uint8) + np.eye(480, 640, dtype=np.uint8) * 90
    )
    out = tmp_path / "camera.yaml"
    stage = CalibrateCamera(images=str(tmp_path / "images"), board=f"{COLUMNS}x{ROWS}", out=str(out))
    stage.run(Context("calibrate"))
    assert worst_deg(read_camera(out), MIRROR) < 0.5
    printed = capsys.readouterr().out
    assert "image 0: 0." in printed
    assert "over 6 images; no board in images 6" in printed
    written = out.read_bytes(), out.with_suffix(".png").read_bytes()
    assert written[1].startswith(b"\x89PNG")
    with pytest.raises(BadInput, match=r"camera\.yaml is there; type another name, or delete it"):
        stage.run(Context("calibrate"))
    out.unlink()
    with pytest.raises(BadInput, match=r"camera\.png is there"):
        stage.run(Context("calibrate"))
    out.with_suffix(".png").unlink()
    stage.run(Context("calibrate"))
    assert (out.read_bytes(), out.with_suffix(".png").read_bytes()) == written
    look = tmp_path / "look.png"
    LookThroughCamera(log=str(tmp_path / "images"), camera=str(out), out=str(look)).run(Context("look"))
    assert cv2.imread(str(look)) is not None


def test_what_cannot_be_calibrated_is_said(tmp_path: Path) -> None:
    cv2.imwrite(str(tmp_path / "0.png"), np.random.default_rng(0).integers(0, 256, (48, 64, 3), dtype=np.uint8))
    for stage, what in (
        (CalibrateCamera(images=str(tmp_path), board="9"), "type board=9x6"),
        (CalibrateCamera(images=str(tmp_path), out="camera.txt"), "type out=camera.yaml"),
        (CalibrateCamera(images=str(tmp_path)), "no board of 9 x 6 inner corners"),
    ):
        with pytest.raises(BadInput, match=what):
            stage.run(Context("calibrate"))


def test_copies_of_an_image_are_one_view_and_odd_sizes_and_names_are_said(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    board, other = (rendered(MIRROR, *pose) for pose in boards(-0.1)[:2])
    images = tmp_path / "images"
    images.mkdir()
    stage = CalibrateCamera(images=str(images), board=f"{COLUMNS}x{ROWS}", out=str(tmp_path / "camera.yaml"))
    with pytest.raises(BadInput, match=f"type images=LAYOUT:{images}"):
        stage.run(Context("calibrate"))
    for number in range(3):
        cv2.imwrite(str(images / f"{number}.png"), board)
    with pytest.raises(BadInput, match="3 different views of the board are needed, 1 found"):
        stage.run(Context("calibrate"))
    assert "image 2: left out, it shows the board where image 0 does" in capsys.readouterr().out
    cv2.imwrite(str(images / "1.png"), other[::2, ::2])
    with pytest.raises(BadInput, match=r"1 of 3 images .*1\.png is 320 x 240, the first one 640 x 480; give images"):
        stage.run(Context("calibrate"))

"""A camera that is plugged in, stood for by a video."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from omninav.pipeline import BadInput, Context
from omninav.stages.recordings.opening import open_recording
from omninav.stages.tools.camera_record import RecordCamera


@pytest.fixture
def device(tmp_path: Path) -> str:
    writer = cv2.VideoWriter(str(tmp_path / "device.avi"), cv2.VideoWriter_fourcc(*"MJPG"), 10.0, (80, 64))
    for number in range(5):
        writer.write(np.random.default_rng(number).integers(0, 256, (64, 80, 3)).astype(np.uint8))
    writer.release()
    return str(tmp_path / "device.avi")


def test_what_a_camera_gives_is_a_log_with_its_camera(tmp_path: Path, device: str) -> None:
    out = str(tmp_path / "drive.mcap")
    RecordCamera(device=device, out=out, camera="perspective", rate_hz=1e6).run(Context("record"))
    recording = open_recording(out)
    assert recording.camera.projection == "perspective"
    assert len(recording.stamps) == 5
    assert all(recording.image(frame) is not None for frame in range(5))


def test_images_that_come_too_fast_are_left_out(tmp_path: Path, device: str) -> None:
    out = str(tmp_path / "drive.mcap")
    RecordCamera(device=device, out=out, camera="perspective", rate_hz=0.01).run(Context("record"))
    assert len(open_recording(out).stamps) == 1
    with pytest.raises(BadInput, match=r"drive\.mcap is there; type another name"):
        RecordCamera(device=device, out=out, camera="perspective").run(Context("record"))


def test_what_cannot_be_recorded_is_said(tmp_path: Path, device: str) -> None:
    other, made = tmp_path / "camera.yaml", tmp_path / "x.mcap"
    other.write_text("{projection: cylindrical, image: {width: 16, height: 4}, column_of_forward: 8, sense: clockwise}")
    for stage, what in (
        (RecordCamera(device=device, camera=str(other), out=str(made)), "of images of 16 x 4, .* gives 80 x 64; name"),
        (RecordCamera(device="/dev/none"), "there is no camera /dev/none; type its number"),
        (RecordCamera(device="987"), "camera 987 cannot be opened"),
        (RecordCamera(device=device, out="drive.avi"), "type out=camera.mcap"),
        (RecordCamera(device=device, out=str(made)), "nothing states how its images of 80 x 64"),
    ):
        with pytest.raises(BadInput, match=what):
            stage.run(Context("record"))
    with pytest.raises(BadInput, match=r"log=camera:0: .*omninav live log=camera:0; .*omninav camera record device=0"):
        open_recording("camera:0")

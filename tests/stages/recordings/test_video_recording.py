"""Videos as logs: every frame at its own time, and what a video does not say."""

import re
from pathlib import Path

import cv2
import numpy as np
import pytest

from omninav.stages.recordings import video_recording
from omninav.stages.recordings.opening import open_recording

from .conftest import refused

LEVELS = tuple(range(20, 240, 20))


def pictures(width: int = 128, height: int = 64) -> list[np.ndarray]:
    """Frames that tell themselves apart: a checkered ground, brighter from one to the next."""
    ground = np.random.default_rng(0).integers(-15, 16, (height // 8, width // 8, 1)).repeat(8, 0).repeat(8, 1)
    return [np.clip(ground + level, 0, 255).astype(np.uint8).repeat(3, 2) for level in LEVELS]


def video(path: Path, frames: list[np.ndarray], code: str = "mp4v", rate: float = 12.5) -> str:
    height, width = frames[0].shape[:2]
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*code), rate, (width, height))
    for frame in frames:
        writer.write(frame)
    writer.release()
    return str(path)


@pytest.mark.parametrize(("name", "code"), [("drive.mp4", "mp4v"), ("drive.AVI", "MJPG"), ("drive.mkv", "mp4v")])
def test_frames_come_in_any_order_at_the_containers_times(tmp_path: Path, name: str, code: str) -> None:
    recording = open_recording(video(tmp_path / name, pictures(), code))
    assert recording.stamps.tolist() == [number * 80_000_000 for number in range(len(LEVELS))]
    for frame in (0, 3, 4, 10, 2, 3):
        image = recording.image(frame)
        assert image is not None
        assert abs(image.mean() - LEVELS[frame]) < 6
    assert not recording.dropped
    assert recording.odometry is recording.truth is None


def test_an_image_twice_as_wide_as_high_is_a_whole_sphere_and_said_to_be_assumed(tmp_path: Path) -> None:
    recording = open_recording(video(tmp_path / "drive.mp4", pictures()))
    assert recording.camera.projection == "equirectangular"
    assert recording.camera.elevations == pytest.approx((np.pi / 2, -np.pi / 2))
    assert "equirectangular" in recording.assumed[0]


def test_frames_that_trimming_hid_are_left_out(tmp_path: Path) -> None:
    path = Path(video(tmp_path / "drive.mp4", pictures()))
    content = bytearray(path.read_bytes())
    entry, header = content.find(b"elst") + 12, content.find(b"mdhd") + 16
    ticks_a_frame = int.from_bytes(content[header : header + 4]) * 2 // 25
    content[entry + 4 : entry + 8] = (3 * ticks_a_frame).to_bytes(4)
    path.write_bytes(content)
    recording = open_recording(str(path))
    assert recording.stamps.tolist() == [number * 80_000_000 for number in range(len(LEVELS) - 3)]
    for frame in (0, len(LEVELS) - 4, 2):
        image = recording.image(frame)
        assert image is not None
        assert abs(image.mean() - LEVELS[frame + 3]) < 6
    assert not recording.dropped


def test_interlaced_frames_are_refused_and_a_camera_at_rest_is_not(tmp_path: Path) -> None:
    path = Path(video(tmp_path / "drive.avi", pictures(), "mpg2", 25.0))
    content = bytearray(path.read_bytes())
    for found in re.finditer(re.escape(b"\0\0\1\xb5"), path.read_bytes()):
        extension = found.end()
        if content[extension] >> 4 == 1:  # of a sequence
            content[extension + 1] &= ~0x08
        elif content[extension] >> 4 == 8:  # of a picture
            content[extension + 4] &= ~0x80
    path.write_bytes(content)
    with refused("-vf yadif"):
        open_recording(str(path))
    for name, code in (("rest.avi", "MJPG"), ("rest.mp4", "mp4v")):
        assert len(open_recording(video(tmp_path / name, pictures(640, 320)[:1] * 12, code)).stamps) == 12


def test_joined_parts_whose_times_begin_again_are_refused(tmp_path: Path) -> None:
    part = Path(video(tmp_path / "part.ts", pictures() * 2, "mpg2", 25.0))
    assert len(open_recording(str(part)).stamps) == 2 * len(LEVELS)
    joined = tmp_path / "joined.ts"
    joined.write_bytes(2 * part.read_bytes())
    with refused("its times begin again at frame 22, .* log=\\[FIRST,SECOND\\]"):
        open_recording(str(joined))


def test_frames_without_times_of_their_own_are_taken_by_number(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def late(capture: cv2.VideoCapture) -> int:
        """As of an AVI with B-frames: the decoder tells when it has the frame, the container when it is shown."""
        return position(capture) + (160_000_000 if capture.get(cv2.CAP_PROP_FORMAT) != -1 else 0)

    position = video_recording._position
    monkeypatch.setattr(video_recording, "_position", late)
    recording = open_recording(video(tmp_path / "drive.avi", pictures(), "MJPG"))
    for frame in (0, 7, 3, len(LEVELS) - 1):
        image = recording.image(frame)
        assert image is not None
        assert abs(image.mean() - LEVELS[frame]) < 6


def test_two_circles_side_by_side_are_no_panorama(tmp_path: Path) -> None:
    rows, columns = np.mgrid[0:64, 0:128]
    circles = np.hypot(columns % 64 - 31.5, rows - 31.5) < 32
    frames = [frame * circles[..., None].astype(np.uint8) for frame in pictures()[4:]]
    with refused("type camera=dual_fisheye"):
        open_recording(video(tmp_path / "drive.mp4", frames))
    with refused("join a video's two tracks"):
        open_recording(video(tmp_path / "one_lens.mp4", pictures(64, 64)), camera="dual_fisheye")


def test_other_images_need_a_camera(tmp_path: Path) -> None:
    path = video(tmp_path / "drive.mp4", pictures(80, 64))
    camera = open_recording(path, camera="perspective").camera
    assert (camera.projection, camera.width, camera.height_px) == ("perspective", 80, 64)
    for named, said in (
        (None, "nothing states how its images of 80 x 64 are to be read; type camera="),
        ("hyperbolic", r"camera=hyperbolic: needs its numbers; .*camera.yaml"),
        ("perspektive", "camera=perspektive: there is no such file or projection; did you mean 'perspective'"),
    ):
        with refused(said):
            open_recording(path, camera=named)


def test_a_camera_of_another_size_is_refused_before_every_frame_is(tmp_path: Path) -> None:
    path = video(tmp_path / "drive.mp4", pictures())
    (tmp_path / "camera.yaml").write_text(
        "{projection: equirectangular, image: {width: 64, height: 32}, column_of_forward: 32}"
    )
    with refused("camera.yaml: it is of images of 64 x 32, and those of .* are 128 x 64"):
        open_recording(path)
    assert open_recording(path, camera="equirectangular").camera.width == 128


def test_a_cut_video_is_read_as_far_as_it_goes(tmp_path: Path) -> None:
    whole = Path(video(tmp_path / "whole.mkv", pictures(), "MJPG")).read_bytes()
    (tmp_path / "cut.mkv").write_bytes(whole[: len(whole) // 2])
    recording = open_recording(str(tmp_path / "cut.mkv"))
    assert 2 < len(recording.stamps) < len(LEVELS)
    images = [recording.image(frame) for frame in range(len(recording.stamps))]
    assert sum(image is None for image in images) == recording.dropped["undecodable_image"]
    assert recording.dropped["missing_frame"] == len(LEVELS) - len(recording.stamps)


def test_frames_that_come_less_often_than_the_stated_rate_are_not_missing(tmp_path: Path) -> None:
    path = Path(video(tmp_path / "slow.mkv", pictures(), "MJPG"))
    content = bytearray(path.read_bytes())
    at = content.index(b"\x23\xe3\x83\x84") + 4  # Matroska's DefaultDuration, of four bytes: ns a frame
    assert content[at : at + 4] == (80_000_000).to_bytes(4)
    content[at : at + 4] = (20_000_000).to_bytes(4)
    path.write_bytes(content)
    assert cv2.VideoCapture(str(path)).get(cv2.CAP_PROP_FRAME_COUNT) > 3 * len(LEVELS)
    assert not open_recording(str(path)).dropped


def test_what_is_no_video_is_refused_before_anything_is_decoded(tmp_path: Path) -> None:
    (tmp_path / "list.mp4").write_text("#EXTM3U\n#EXTINF:1,\nfile:///etc/passwd\n")
    (tmp_path / "cut.mp4").write_bytes(Path(video(tmp_path / "whole.mp4", pictures())).read_bytes()[:2000])
    (tmp_path / "folder.mp4").mkdir()
    for name, said in (
        ("list.mp4", "this is no video"),
        ("cut.mp4", "restores from a whole video"),
        ("folder.mp4", "no recording is in this folder"),
        ("missing.mp4", "no such file"),
    ):
        with refused(said):
            open_recording(str(tmp_path / name))

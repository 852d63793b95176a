"""Which format opens what a user names."""

from collections.abc import Iterable
from pathlib import Path

import cv2
import numpy as np
import pytest
from made_logs import IMAGE, messages, write_mcap

from omninav.stages.recordings.opening import log_formats, open_recording
from omninav.stages.recordings.recording import FORMATS, Format, OpenOptions, Recording

from .conftest import refused


def test_every_format_says_what_it_opens() -> None:
    names = "; ".join(one.names for one in log_formats())
    for kind in (".mcap", ".bag", ".db3", "rosbag2 folder", "LAYOUT:FOLDER", "recording.yaml"):
        assert kind in names


def test_a_format_that_a_user_wrote_opens_its_names(tmp_path: Path) -> None:
    class Renamed(Format):
        names = "a .drive file"
        suffixes = (".drive",)

        def open(self, log: str, options: OpenOptions) -> Recording:
            return open_recording(log.replace(".drive", ".mcap"))

    try:
        write_mcap(tmp_path / "one.mcap")
        (tmp_path / "one.drive").touch()
        renamed, plain = (open_recording(str(tmp_path / f"one.{suffix}")) for suffix in ("drive", "mcap"))
        assert renamed.digest() == plain.digest()
        with refused(r"no such file \(in that folder: one\.drive\)$"):
            open_recording(str(tmp_path / "two.drive"))
    finally:
        FORMATS.remove(Renamed)


def test_the_record_of_a_stopped_live_run_says_how_it_is_closed(tmp_path: Path) -> None:
    write_mcap(tmp_path / "live.mcap").rename(tmp_path / "live.mcap.unfinished")
    with refused(r"the record of a live run that was stopped; `omninav resume .*` goes on and closes it"):
        open_recording(str(tmp_path / "live.mcap.unfinished"))
    with refused(r"no such file \(in that folder: live\.mcap\.unfinished\)$"):
        open_recording(str(tmp_path / "live.mcap"))


def images(folder: Path, *suffixes: str) -> Path:
    """A folder with an image of each suffix."""
    folder.mkdir(parents=True)
    for number, suffix in enumerate(suffixes):
        pixels = np.random.default_rng(number).integers(0, 255, (64, 128, 3), np.uint8)
        assert cv2.imwrite(str(folder / f"image_{number}{suffix}"), pixels)
    return folder


def test_images_of_one_kind_may_spell_it_differently_and_others_are_counted(tmp_path: Path) -> None:
    folder = images(tmp_path / "card", ".jpg", ".JPG", ".png", ".jpeg", ".JPEG", ".tif")
    recording = open_recording(str(folder))
    assert (len(recording.stamps), recording.dropped["another_kind"]) == (4, 2)
    assert len(open_recording(str(images(tmp_path / "scans", ".TIF", ".tiff"))).stamps) == 2


def test_images_of_several_series_in_one_folder_are_told(tmp_path: Path) -> None:
    folder = images(tmp_path / "stereo", ".jpg", ".jpg")
    assert "images of" not in " ".join(open_recording(str(folder)).assumed)
    (folder / "image_1.jpg").rename(folder / "right_0.jpg")
    assert "images of 2 series, image_# (1), right_# (1)" in " ".join(open_recording(str(folder)).assumed)
    for old, new in (("image_0", "cam1_0"), ("right_0", "cam2_0")):
        (folder / f"{old}.jpg").rename(folder / f"{new}.jpg")
    assert "images of 2 series, cam1_# (1), cam2_# (1)" in " ".join(open_recording(str(folder)).assumed)
    (folder / "cam2_0.jpg").rename(folder / "cam1_1.jpg")
    assert "images of" not in " ".join(open_recording(str(folder)).assumed)


@pytest.mark.parametrize(
    ("numbers", "begins_again"),
    [((9998, 9999, 0, 1, 2), True), ((9998, 9999), False), (range(0, 10_000, 3333), False), ((0, 1, 2, 3), False)],
)
def test_numbers_that_a_camera_may_have_begun_again_are_told(
    tmp_path: Path, numbers: Iterable[int], begins_again: bool
) -> None:
    for number in numbers:
        cv2.imwrite(str(tmp_path / f"img_{number:04}.png"), np.full((32, 64, 3), 90, np.uint8))
    told = "did these begin again after 9999? Rename them"
    assert (told in " ".join(open_recording(str(tmp_path)).assumed)) == begins_again


def test_a_folder_with_files_of_two_formats_is_refused_with_its_parts(tmp_path: Path) -> None:
    (tmp_path / "second.db3").touch()
    write_mcap(tmp_path / "first.mcap")
    with refused(r"it holds MCAP and SQLite files .*; give each part: log=\[.*first\.mcap,.*second\.db3\]"):
        open_recording(str(tmp_path))


def test_images_of_two_cameras_on_one_topic_are_told(tmp_path: Path) -> None:
    made = list(messages())
    for number, image in enumerate(each for each in made if each.topic == IMAGE):
        image.content.header.frame_id = "left" if number % 2 else "right"
    told = open_recording(str(write_mcap(tmp_path / "two.mcap", iter(made)))).assumed
    assert any("carries images of several cameras ('right', 'left')" in sentence for sentence in told)


def test_a_name_that_nothing_opens_says_what_to_type(tmp_path: Path) -> None:
    with refused(r"no recording is in this folder .* type log=LAYOUT:.*antworld"):
        open_recording(str(tmp_path))
    with refused(r"type log=.*/of_a_phone/day$"):
        open_recording(str(images(tmp_path / "of_a_phone" / "day", ".jpg").parent))
    (tmp_path / "of_a_phone" / "IMG_1.HEIC").touch()
    with refused("HEIC and raw images are not read; export them"):
        open_recording(str(tmp_path / "of_a_phone"))
    (tmp_path / "notes.txt").touch()
    with refused(r"notes\.txt: not a recording; name .*\.mcap"):
        open_recording(str(tmp_path / "notes.txt"))
    bags = tmp_path / "bags"
    bags.mkdir()
    for number in range(4):
        (bags / f"{number}.bag").touch()
    with refused(r"no recording is in this folder .* type log=\[.*/0\.bag,.*/1\.bag,.*/2\.bag,…\]$"):
        open_recording(str(bags))
    (tmp_path / "cut.bag.active").touch()
    with refused(r"cut\.bag\.active: a bag that was never closed; `rosbag reindex` closes it"):
        open_recording(str(tmp_path / "cut.bag.active"))

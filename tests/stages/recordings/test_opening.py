"""Which format opens what a user names."""

from pathlib import Path

from made_logs import write_mcap

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


def test_a_name_that_nothing_opens_says_what_to_type(tmp_path: Path) -> None:
    with refused(r"no recording is in this folder .* type log=LAYOUT:.*antworld"):
        open_recording(str(tmp_path))
    (tmp_path / "notes.txt").touch()
    with refused(r"notes\.txt: not a recording; name .*\.mcap"):
        open_recording(str(tmp_path / "notes.txt"))

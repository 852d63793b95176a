"""Files appear whole or not at all."""

import errno
import os
import subprocess
import sys
from pathlib import Path

import pytest

from omninav.pipeline.files import whole_file, write_whole


def test_what_a_killed_process_left_is_removed_by_the_next_and_nothing_else(tmp_path: Path) -> None:
    ended = subprocess.Popen([sys.executable, "-c", ""])
    ended.wait()
    here = f"@{os.uname().nodename}.part"
    left = tmp_path / f"out.mcap.{ended.pid}{here}"
    names = (f"out.mcap.{os.getppid()}{here}", f"out.{ended.pid}{here}", f"out.mcap.x{here}")
    others = [tmp_path / name for name in (*names, f"out.mcap.{ended.pid}@elsewhere.part")]
    for file in (left, *others):
        file.write_bytes(b"half")
    write_whole(tmp_path / "out.mcap", b"whole")
    assert not left.exists()
    assert all(file.exists() for file in others)
    assert (tmp_path / "out.mcap").read_bytes() == b"whole"


def test_an_error_names_the_file_and_not_the_temporary_one(tmp_path: Path) -> None:
    for name in (None, "part"):
        with pytest.raises(OSError, match=rf"'{tmp_path}/map\.omap'$"), whole_file(tmp_path / "map.omap") as part:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), name and str(part))


def test_what_no_text_can_hold_is_written_as_its_number(tmp_path: Path) -> None:
    write_whole(tmp_path / "page.html", "a file named \udcff")
    assert (tmp_path / "page.html").read_text(encoding="utf-8") == "a file named \\udcff"

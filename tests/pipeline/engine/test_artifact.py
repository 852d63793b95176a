"""Artifact files: what they hold, and what is said of those that cannot be read."""

import hashlib
import io
import json
import zipfile
from pathlib import Path

import pytest

from omninav.pipeline import BadInput
from omninav.pipeline.engine.artifact import read_artifact, read_header, type_of, write_artifact
from toys import Number


def with_header(path: Path, **changes: object) -> Path:
    """A file like one of another version: its header changed, its sum made to fit."""
    header = read_header(path) | changes
    buffer = io.BytesIO()
    with zipfile.ZipFile(path) as old, zipfile.ZipFile(buffer, "w") as new:
        for name in old.namelist():
            new.writestr(name, json.dumps(header) if name == "header.json" else old.read(name))
        new.comment = b" " * (len("sha256:") + 64)
    whole = buffer.getvalue()[: -len("sha256:") - 64]
    path.write_bytes(whole + b"sha256:" + hashlib.sha256(whole).hexdigest().encode())
    return path


@pytest.fixture
def file(tmp_path: Path) -> Path:
    write_artifact(tmp_path / "known.omap", Number(2.5), {"made": "by hand"})
    return tmp_path / "known.omap"


def test_a_value_and_how_it_was_made_come_back(file: Path):
    assert read_artifact(file).value == 2.5
    assert type_of(file) is Number
    assert read_header(file)["facts"] == {"made": "by hand"}


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        (
            {"type": "omninav.stages.value.maps.OldMap"},
            r"made with an older omninav \(its 'omninav.*OldMap' is no longer",
        ),
        ({"type": "omninav.stages.values.maps.OldMap"}, "made with an older omninav"),
        ({"type": "elsewhere.Map"}, "holds a 'elsewhere.Map', which is no value known here; load the stage"),
        ({"type": "toys.Word"}, "does not fit Word of this version"),
        ({"format": 0}, "written in format 0, this version reads 1; make it again"),
    ],
)
def test_a_file_of_another_version_is_refused_in_one_line(file: Path, changes: dict, message: str):
    with pytest.raises(BadInput, match=message) as refused:
        read_artifact(with_header(file, **changes))
    assert str(refused.value).startswith(f"{file}: ")
    assert "\n" not in str(refused.value)

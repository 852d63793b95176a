"""Artifact files: what they hold, and what is said of those that cannot be read."""

import hashlib
import io
import json
import zipfile
from pathlib import Path
from typing import Annotated

import numpy as np
import numpy.typing as npt
import pytest
from memory_peak import memory_peak

from omninav.pipeline import BadInput, Value
from omninav.pipeline.engine.artifact import read_artifact, read_header, type_and_facts, write_artifact
from omninav.pipeline.graph.contents import Shape
from toys import Number


class Points(Value):
    points: Annotated[npt.NDArray[np.float64], Shape("N", 2)]


def with_header(path: Path, **changes: object) -> Path:
    """A file like one of another version: its header changed, its sum made to fit."""
    return with_members(path, **{"header.json": json.dumps(read_header(path) | changes).encode()})


def with_members(path: Path, **members: bytes | None) -> Path:
    """A file with other members (None: without it), its sum made to fit."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(path) as old, zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as new:
        for name, content in ({name: old.read(name) for name in old.namelist()} | members).items():
            if content is not None:
                new.writestr(name, content)
        new.comment = b" " * (len("sha256:") + 64)
    whole = buffer.getvalue()[: -len("sha256:") - 64]
    path.write_bytes(whole + b"sha256:" + hashlib.sha256(whole).hexdigest().encode())
    return path


def npy(header: str) -> bytes:
    """A .npy file that says it holds something and holds nothing."""
    packed = header.encode().ljust(118) + b"\n"
    return b"\x93NUMPY\x01\x00" + len(packed).to_bytes(2, "little") + packed


@pytest.fixture
def file(tmp_path: Path) -> Path:
    dropped = {"blurred": 3, "dark": {"count": 2, "first": "at 7 s"}}
    facts = {"variant": None, "stages": {"unwarp": {"width": 90}}, "warnings": ["dark"], "dropped": dropped}
    write_artifact(tmp_path / "known.omap", Number(2.5), facts)
    return tmp_path / "known.omap"


def test_of_a_folder_the_files_in_it_are_named(file: Path):
    with pytest.raises(BadInput, match=r"this is a folder, expected a file in it: known\.omap"):
        read_artifact(file.parent)


def test_a_missing_or_foreign_file_is_refused_by_name(tmp_path: Path):
    with pytest.raises(BadInput, match="there is no such file"):
        read_artifact(tmp_path / "none.omap")
    (tmp_path / "text.omap").write_text("not a map at all, but long enough to hold a sum " * 9)
    with pytest.raises(BadInput, match="not an artifact file"):
        read_artifact(tmp_path / "text.omap")


def test_a_value_and_how_it_was_made_come_back_and_its_file_opens_in_numpy(tmp_path: Path):
    path, points = tmp_path / "map.omap", Points(np.arange(6.0).reshape(3, 2))
    write_artifact(path, points, {"poses": "truth"})
    assert np.array_equal(read_artifact(path).points, points.points)
    assert type_and_facts(path)[0] is Points
    assert read_header(path)["facts"] == {"poses": "truth"}
    with np.load(path, allow_pickle=False) as archive:
        assert np.array_equal(archive["points"], points.points)
    first = path.read_bytes()
    write_artifact(path, points, {"poses": "truth"})
    assert path.read_bytes() == first


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        (
            {"type": "omninav.stages.value.maps.OldMap"},
            r"made with an older omninav \(its 'omninav.*OldMap' is no longer",
        ),
        ({"type": "omninav.stages.values.maps.OldMap"}, "made with an older omninav"),
        ({"type": "omninav.__main__.X"}, "no longer known"),
        ({"type": "elsewhere.Map"}, "holds a 'elsewhere.Map', which is no value known here; load the stage"),
        ({"type": "toys.Word"}, "does not fit Word of this version"),
        ({"format": 0}, "written in format 0, this version reads up to 2; make it again"),
        ({"facts": {"variant": float("inf")}}, "its header holds Infinity"),
        ({"facts": {"variant": {}}}, "its header's variant is a dict, expected a name"),
        ({"facts": {"dropped": 5}}, "its header's dropped is 5, expected counts by kind"),
        ({"facts": {"dropped": {"blurred": True}}}, "its header's dropped is a dict, expected counts by kind"),
        ({"facts": {"dropped": {"blurred": {"first": "dark"}}}}, "dropped is a dict, expected counts by kind"),
        ({"facts": {"dropped": {"blurred": {"count": 2, "first": 3}}}}, "dropped is a dict, expected counts by kind"),
        ({"facts": {"facts": [1]}}, "its header's facts is"),
        ({"facts": {"stages": 7}}, "its header's stages is 7, expected parameters by stage"),
        ({"facts": {"stages": {"unwarp": 3}}}, "its header's stages is a dict, expected parameters by stage"),
        ({"facts": {"made_by": 3}}, "its header's made_by is 3, expected a name"),
        ({"facts": {"warnings": "dark"}}, "its header's warnings is"),
        ({"facts": {"warnings": ["dark", 3]}}, "its header's warnings is a list, expected texts"),
        ({"arrays": []}, "its header states no arrays"),
    ],
)
def test_a_file_of_another_version_is_refused_in_one_line(file: Path, changes: dict, message: str):
    with pytest.raises(BadInput, match=message) as refused:
        read_artifact(with_header(file, **changes))
    assert str(refused.value).startswith(f"{file}: ")
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(
    ("members", "message"),
    [
        ({"header.json": None}, "not a valid artifact"),
        ({"header.json": b"[1]"}, "written in format None"),
        ({"header.json": b"[" * 100_000}, "not a valid artifact"),
        ({"rest.npy": b""}, "not a valid artifact"),
        ({"rest.npy": npy("{'descr': '<f8', 'fortran_order': False, 'shape': (4611686018427387904,)}")}, "as long as"),
        ({"rest.npy": npy("{'descr': '|O', 'fortran_order': False, 'shape': (1,)}")}, "as long as it states"),
        ({"rest.npy": npy("{'descr': '|V0', 'fortran_order': False, 'shape': (16777217,)}")}, "has 16777217 rows"),
        ({"surplus.npy": bytes(100_000_000)}, r"it would unpack \d+ bytes to 1000\d+"),
    ],
)
def test_a_file_whose_sum_is_right_and_whose_content_is_not_is_refused(file: Path, members: dict, message: str):
    with pytest.raises(BadInput, match=message) as refused:
        read_artifact(with_members(file, **members))
    assert str(refused.value).startswith(f"{file}: ")
    assert len(str(refused.value)) < 500


def test_a_value_that_does_not_hold_what_its_fields_state_is_refused_by_name(tmp_path: Path):
    write_artifact(tmp_path / "points.omap", Points(np.array([[0.0, np.nan]])))
    with pytest.raises(BadInput, match="it is not a valid Points: 'points' holds nan"):
        read_artifact(tmp_path / "points.omap")


def test_a_file_needs_no_memory_twice(tmp_path: Path):
    points = Points(np.random.default_rng(0).random((1_000_000, 2)))  # 16 MB
    assert memory_peak(write_artifact, tmp_path / "points.omap", points) < 8e6
    assert np.array_equal(read_artifact(tmp_path / "points.omap").points, points.points)

"""Saved maps are joined, thinned, cut and shown."""

import re
from dataclasses import replace
from pathlib import Path

import cv2
import made_places
import numpy as np
import pytest
from landmark_tour import mapped_room
from small_run import reference_graph

from omninav.pipeline import BadInput, Context
from omninav.pipeline.cli.main import main
from omninav.pipeline.engine.artifact import read_artifact, write_artifact
from omninav.stages.geometry.plane.se2 import between
from omninav.stages.map_files.references import thinned_references
from omninav.stages.tools.map_join import JoinMaps
from omninav.stages.tools.map_show import described
from omninav.stages.values.maps import ReferenceGraph
from omninav.stages.values.projection import Projection


@pytest.fixture(autouse=True)
def _here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def map_of(file: Path, count: int, **fields: object) -> Path:
    map = reference_graph(count)
    map.put(**fields)
    write_artifact(file, map, {"variant": "made", "stages": {"features": {"_target_": "x.Colours", "bins": 4}}})
    return file


def test_maps_are_joined_thinned_cut_and_shown(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    map_of(tmp_path / "it's a map.omap", 40)
    map_of(tmp_path / "b.omap", 30)
    assert main(["map", "join", "it's a map.omap", "b.omap", "out=c.omap"]) == 0
    assert main(["map", "thin", "c.omap", "spacing=2", "out=d.omap"]) == 0
    assert main(["map", "cut", "d.omap", "area=[0,-4,8,4]", "out=e.omap"]) == 0
    assert main(["map", "show", "c.omap", "e.omap"]) == 0
    said = capsys.readouterr().out
    assert "c.omap: 70 references of 2 maps (40 + 30)" in said
    assert "of 70 references, at least 2 m apart" in said
    assert "features     Colours, bins=4" in said
    assert "made by      cut area=[0.0, -4.0, 8.0, 4.0]" in said
    assert main(["map", "show", "c.omap"]) == 0  # its own picture, not another's
    assert cv2.imwrite(str(tmp_path / "map.png"), np.zeros((9, 9), np.uint8))
    assert main(["map", "show", "c.omap"]) == 2
    assert "out=map.png: it is there, and omninav did not draw it; type another name" in capsys.readouterr().err
    assert cv2.imread(str(tmp_path / "map.png")).shape == (9, 9, 3)
    first = (tmp_path / "d.omap").read_bytes()
    assert main(["map", "thin", "c.omap", "spacing=2", "out=d.omap"]) == 0
    assert (tmp_path / "d.omap").read_bytes() == first


def test_what_a_map_holds_is_said_in_numbers(tmp_path: Path) -> None:
    poses = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 2.0, 0.0]])
    file = map_of(tmp_path / "a.omap", 3, poses=poses)
    assert list(described(file, read_artifact(file))) == [
        ("map", f"{file} (ReferenceGraph, 0.00 MB)"),
        ("references", "3, 2 edges between them"),
        ("views", "histograms, 10 segments x 20, 0.0 MB"),
        ("landmarks", "none; type landmarks=sift where a map is made"),
        ("poses from", "truth"),
        ("area", "1.0 x 2.0 m: x 0.0 to 1.0, y 0.0 to 2.0"),
        ("spacing", "1.00 m to the nearest other (median), 2.00 m at most"),
        ("features", "Colours, bins=4"),
        ("variant", "made"),
    ]
    places = made_places.made_map([(0, 0), (1, 0)], {(0, 1): 3}, names=["a", ""])
    assert list(described(file, places))[1:3] == [
        ("places", "2 (1 names), 1 links, 3 path images"),
        ("views", "5, of 1 patches on average"),
    ]
    assert [name for name, _ in described(file, made_places.made_map([(0, 0)], {}))][4:6] == ["area", "features"]


def test_a_map_is_shown_with_its_landmarks(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    map = mapped_room()
    write_artifact(tmp_path / "a.omap", map)
    write_artifact(tmp_path / "b.omap", replace(map, landmarks=None))
    few = replace(map, poses=map.poses[:4], features=map.features[:4], edges=map.edges[:0])
    for name, rows in (("c", [0, 2]), ("d", [0, 99, 2])):  # 99: a reference that came after the landmarks
        write_artifact(tmp_path / f"{name}.omap", replace(few, landmarks=map.landmarks.of_references(np.array(rows))))
    median = np.median(np.diff(map.landmarks.starts))
    for name, said in (
        ("a", f"{len(map.landmarks)}, a reference sees {median:.0f} (median); bearings to "),
        ("b", "none; type landmarks=sift"),
        ("c", f"{len(map.landmarks.seen_by(np.array([0, 2])))}, a reference sees "),
        ("d", ""),
    ):
        out = tmp_path / f"{name}.png"
        assert main(["map", "show", str(tmp_path / f"{name}.omap"), f"out={out}"]) == 0
        shown = capsys.readouterr().out
        assert f"landmarks    {said}" in shown
        assert ("(median), 2 references see none; bearings" in shown) is (name in "cd")
    with_landmarks, without = (cv2.imread(str(tmp_path / f"{name}.png")) for name in ("a", "b"))
    assert (with_landmarks < 200).sum() > 1.3 * (without < 200).sum()


def test_a_joined_map_says_what_became_of_landmarks(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    map = mapped_room()
    write_artifact(tmp_path / "a.omap", map)
    write_artifact(tmp_path / "again.omap", map, {"tour": "again.mcap"})
    write_artifact(tmp_path / "b.omap", replace(map, landmarks=None))
    other = replace(map.landmarks.words, centres=map.landmarks.words.centres[::-1].copy())
    write_artifact(tmp_path / "c.omap", replace(map, landmarks=replace(map.landmarks, words=other)))
    number = len(map.landmarks)
    for maps, said in (
        (["a", "again"], f"landmarks: {2 * number}\n"),
        (["a", "b"], f"landmarks: {number}, none from b.omap, where images are compared as a whole\n"),
        (["c", "a"], f"landmarks: {2 * number}, with visual words learned from all of them\n"),
    ):
        assert main(["map", "join", *(f"{name}.omap" for name in maps)]) == 0
        assert said in capsys.readouterr().out


def test_maps_that_do_not_join_are_refused_in_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    map_of(tmp_path / "a.omap", 5)
    map_of(tmp_path / "drift.omap", 5, pose_source="odometry")
    map_of(tmp_path / "other.omap", 5)
    write_artifact(tmp_path / "other.omap", reference_graph(5), {"stages": {"features": {"_target_": "x.Colours"}}})
    write_artifact(tmp_path / "places.omap", made_places.made_map([(0, 0), (1, 0)], {(0, 1): 1}))
    write_artifact(tmp_path / "projection.omap", Projection(np.eye(3, 12, dtype=np.float32), np.array([0.5, 0.3, 0.1])))
    refused = {
        ("join", "a.omap"): "maps: 1 files are given, expected at least 2 maps",
        ("join", "a.omap", "a.omap"): "a.omap: this map is given twice",
        ("join", "a.omap", "drift.omap"): "type same_frame=true if it is",
        ("join", "a.omap", "other.omap"): "were made with other features than a.omap's (bins=None and 4)",
        ("join", "a.omap", "places.omap"): "maps of one kind can be joined",
        ("join", "a.omap", "projection.omap"): "projection.omap: it holds a Projection",
        ("thin", "a.omap", "out=./a.omap"): "this map is read; type another name",
        ("thin", "a.omap", "out=b.txt"): "type out=NAME.omap",
        ("thin", "a.omap", "b.omap"): "maps: 2 files are given, expected 1 map",
        ("cut", "a.omap", "area=[90,90,91,91]"): "nothing of a.omap is there; it goes from [",
        ("show", "projection.omap"): "it holds a Projection, no map",
        ("show", "none.omap"): "none.omap: there is no such file",
    }
    for words, said in refused.items():
        assert main(["map", *words]) == 2
        lines = [line for line in capsys.readouterr().err.splitlines() if not line.startswith("{")]
        assert said in lines[-1], lines
        assert len(lines) == 1
    assert main(["map", "join", "a.omap", "drift.omap", "same_frame=true"]) == 0
    joined = read_artifact(tmp_path / "joined.omap")
    assert isinstance(joined, ReferenceGraph)
    assert joined.pose_source == "estimate"


def elsewhere() -> ReferenceGraph:
    """The room by every other of its references, in a frame of its own."""
    map = thinned_references(mapped_room(), 1.1)
    return replace(map.moved(between(np.array([4.0, -7.0, 2.5]), map.poses)), pose_source="odometry")


def test_true_poses_of_two_frames_are_not_joined_unless_it_is_asked(tmp_path: Path) -> None:
    here, there = mapped_room(), replace(elsewhere(), pose_source="truth")
    files = [str(tmp_path / f"{name}.omap") for name in ("here", "there", "again")]
    for file, map in zip(files, (here, there, here), strict=True):
        write_artifact(Path(file), replace(map, pose_source="truth"), {"stages": {}, "name": file})
    out = str(tmp_path / "both.omap")
    with pytest.raises(BadInput, match=r"there\.omap: by landmarks .* m from where its true poses have it"):
        JoinMaps(maps=tuple(files[:2]), out=out).run(Context("join"))
    JoinMaps(maps=tuple(files[:2]), out=out, same_frame=True).run(Context("join"))
    JoinMaps(maps=(files[0], files[2]), out=out).run(Context("join"))
    with pytest.raises(BadInput, match=r"here\.omap: this map is given twice"):
        JoinMaps(maps=(files[0], files[2], files[0]), out=out).run(Context("join"))


@pytest.mark.parametrize(("order", "source"), [((0, 1), "estimate"), ((1, 0), "odometry")])
def test_measured_poses_in_the_frame_of_true_ones_are_estimates(
    tmp_path: Path, order: tuple[int, int], source: str, capsys: pytest.CaptureFixture[str]
) -> None:
    out, maps = tmp_path / "both.omap", (mapped_room(), elsewhere())
    files = [str(tmp_path / f"{number}.omap") for number in order]
    for file, number in zip(files, order, strict=True):
        write_artifact(Path(file), maps[number], {"stages": {}})
    JoinMaps(maps=tuple(files), out=str(out)).run(Context("join"))
    assert read_artifact(out).pose_source == source
    said = r"aligned by \d+ landmarks that are in several maps; moved by \d+\.\d\d m at most\n"
    assert re.match(said, capsys.readouterr().out)

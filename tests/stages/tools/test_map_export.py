"""Maps as folders of images, and what is refused."""

import errno
import os
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from landmark_tour import mapped_room
from small_run import reference_graph

from omninav.pipeline import BadInput, Context
from omninav.pipeline.cli.main import main
from omninav.pipeline.engine.artifact import write_artifact
from omninav.stages.plots.thumbnails import joined
from omninav.stages.tools.map_export import ExportMap, spaced

CTX = Context("export")
WIDE = 36


def grey(number: int) -> bytes:
    """A panorama that is `number` grey, and white straight ahead."""
    pixels = np.full((8, WIDE, 3), 10 * number, np.uint8)
    pixels[:, 14:22] = 255
    return cv2.imencode(".png", pixels)[1].tobytes()


def saved(folder: Path, references: int = 6, images: int | None = 6, missing: int | None = None) -> str:
    """A map of references a metre or so apart, and its images beside it."""
    map = reference_graph(references)
    map.put(poses=np.column_stack([np.arange(float(references)), np.zeros((references, 2))]))
    write_artifact(folder / "map.omap", map)
    if images is not None:
        jpegs = [b"" if number == missing else grey(number) for number in range(images)]
        write_artifact(folder / "thumbnails.omap", joined(jpegs))
    return str(folder / "map.omap")


def written(folder: Path) -> list[int]:
    """The grey of each image of a folder, by number."""
    files = sorted(folder.iterdir(), key=lambda path: int(path.stem))
    assert [path.name for path in files] == [f"{number}.png" for number in range(len(files))]
    return [int(cv2.imread(str(path))[0, 0, 0]) // 10 for path in files]


def test_images_are_numbered_in_the_order_of_the_tour(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    saved(tmp_path)
    out = tmp_path / "a" / "topomap"
    assert main(["map", "export", str(tmp_path / "map.omap"), f"out={out}"]) == 0
    assert written(out) == [0, 1, 2, 3, 4, 5]
    assert "images of 6 of 6 views, 0.png to 5.png" in capsys.readouterr().out
    assert [path.name for path in out.parent.iterdir()] == ["topomap"]


def test_a_full_disk_is_said_with_the_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    def fill(path: Path, content: bytes) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    map = saved(tmp_path)
    monkeypatch.setattr(Path, "write_bytes", fill)
    with pytest.raises(OSError, match=rf"No space left on device: '{tmp_path}/out'$"):
        ExportMap(maps=map, out=str(tmp_path / "out")).run(CTX)


def test_images_are_spaced_and_missing_ones_are_passed_over(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    ExportMap(maps=saved(tmp_path, missing=2), spacing=2.0, out=str(tmp_path / "out")).run(CTX)
    assert written(tmp_path / "out") == [0, 3, 5]
    assert "; 1 have none" in capsys.readouterr().out
    assert spaced(np.array([(0.0, 0.0), (0.5, 0.0), (1.0, 0.0), (0.9, 0.9)]), 1.0).tolist() == [0, 2]


def test_what_a_forward_camera_sees_is_cut_out_of_the_middle(tmp_path: Path):
    ExportMap(maps=saved(tmp_path), field_deg=75, out=str(tmp_path / "out")).run(CTX)
    image = cv2.imread(str(tmp_path / "out" / "3.png"))
    assert image.shape == (8, 8, 3)
    assert (image == 255).all()
    single = tmp_path / "map.omap"
    write_artifact(single, replace(reference_graph(6), features=np.zeros((6, 1, 20), np.float32)))
    with pytest.raises(BadInput, match=r"field_deg=80: the images of .*map\.omap are no panoramas; leave it out"):
        ExportMap(maps=str(single), field_deg=80, out=str(tmp_path / "other")).run(CTX)


def test_maps_without_their_images_are_refused(tmp_path: Path):
    out = str(tmp_path / "out")
    lone = saved(tmp_path, images=None)
    with pytest.raises(BadInput, match=r"holds no images, and there is no thumbnails\.omap beside it; export the map"):
        ExportMap(maps=lone, out=out).run(CTX)
    with pytest.raises(BadInput, match=r"has 4 images, .*map\.omap has 6 views: another map's"):
        ExportMap(maps=saved(tmp_path, images=4), out=out).run(CTX)
    with pytest.raises(BadInput, match=r"it holds a ReferenceGraph, expected images"):
        ExportMap(maps=lone, images=lone, out=out).run(CTX)
    with pytest.raises(BadInput, match=r"it has no image to write"):
        ExportMap(maps=saved(tmp_path, references=1, images=1, missing=0), out=out).run(CTX)
    assert not (tmp_path / "out").exists()


def test_a_folder_that_holds_something_is_left_alone(tmp_path: Path):
    name = saved(tmp_path)
    with pytest.raises(BadInput, match="it is there, and not an empty folder"):
        ExportMap(maps=name, out=str(tmp_path)).run(CTX)


def test_an_image_that_is_none_is_named_and_nothing_is_left(tmp_path: Path):
    name = saved(tmp_path)
    write_artifact(tmp_path / "thumbnails.omap", joined([grey(0), b"no image", *[grey(n) for n in range(2, 6)]]))
    with pytest.raises(BadInput, match=r"thumbnails\.omap: image 1 cannot be decoded"):
        ExportMap(maps=name, out=str(tmp_path / "out")).run(CTX)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["map.omap", "thumbnails.omap"]


def test_landmarks_are_written_as_a_point_cloud(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    map = mapped_room()
    write_artifact(tmp_path / "map.omap", map)
    assert main(["map", "export", str(tmp_path / "map.omap"), f"out={tmp_path / 'points.ply'}"]) == 0
    assert f"points.ply: {len(map.landmarks)} landmarks" in capsys.readouterr().out
    header, points = (tmp_path / "points.ply").read_bytes().split(b"end_header\n", 1)
    assert header.split(b"\n")[1:3] == [b"format binary_little_endian 1.0", b"element vertex %d" % len(map.landmarks)]
    assert np.frombuffer(points, "<f8").reshape(-1, 3).tolist() == map.landmarks.points.tolist()


def test_a_map_without_landmarks_has_no_point_cloud(tmp_path: Path):
    with pytest.raises(BadInput, match="it has no landmarks to write; type landmarks=sift"):
        ExportMap(maps=saved(tmp_path), out=str(tmp_path / "points.ply")).run(CTX)
    assert not (tmp_path / "points.ply").exists()

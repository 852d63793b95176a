"""Every camera that can be named: looked through, checked, and driven with, by every localiser."""

from pathlib import Path

import cv2
import numpy as np
import pytest
from conftest import DATA, DRIVE, GRID, TOUR, Command, needs_data
from made_rings import ring_picture

from omninav.pipeline.cli.main import main
from omninav.stages.camera.model import camera_models

DISC = {
    "image": "{width: 160, height: 120}",
    "K": "[[125, 0, 79.5], [0, 125, 59.5], [0, 0, 1]]",
    "mask": "{inner_radius_px: 9, outer_radius_px: 58}",
}
STRIP = {"image": "{width: 160, height: 80}"}
FILES: dict[str, dict[str, str]] = {
    "hyperbolic": DISC | {"mirror": "{a: 28.095, b: 23.4125}"},
    "donut": DISC | {"centre": "{x: 79.5, y: 59.5}"},
    "cylindrical": STRIP | {"column_of_forward": "80"},
    "equirectangular": STRIP | {"column_of_forward": "80", "elevation": "{top: 1.5, bottom: -1.5}"},
    "fisheye": DISC | {"focal_px": "38"},
    "double_sphere": DISC
    | {"K": "[[40, 0, 79.5], [0, 40, 59.5], [0, 0, 1]]", "double_sphere": "{xi: -0.2, alpha: 0.6}"},
    "kannala_brandt": DISC | {"K": "[[38, 0, 79.5], [0, 38, 59.5], [0, 0, 1]]", "D": "[-0.01, 0.004, -0.003, 0.0006]"},
    "unified": DISC
    | {"K": "[[60, 0, 79.5], [0, 60, 59.5], [0, 0, 1]]", "xi": "0.9", "D": "[-0.1, 0.02, 0, 0]", "looks": "down"},
    "ocamcalib": DISC
    | {"centre": "{x: 79.5, y: 59.5}", "ocamcalib": "{polynomial: [-40, 0, 0.008], c: 1, d: 0, e: 0, looks: down}"},
    "dual_fisheye": STRIP
    | {"focal_px": "24", "ahead": "{x: 39.5, y: 39.5}", "back": "{x: 119.5, y: 39.5}", "mask": "{outer_radius_px: 39}"},
    "perspective": DISC,
}
"""The keys of a camera.yaml of each projection, for images of one of two sizes."""
NAMES = ("equirectangular", "dual_fisheye", "fisheye", "perspective", "donut")
"""Projections that need no file."""
CAMERAS = [*NAMES, *(f"{name}.yaml" for name in FILES)]
VARIANTS = ("omninav", "omniview_mcl", "plain_matching", "topological_localisation")
USES = [(camera, variant) for camera in ("equirectangular", "perspective") for variant in VARIANTS] + [
    (f"{name}.yaml", "plain_matching") for name in FILES if name not in ("equirectangular", "perspective")
]
"""Pairs of camera and variant that are run: one camera that sees the full circle, one that does not, and all others."""
ORDINARY = ["unwarp=window", "nodes.unwarp.directions=1"]
"""What docs/logs.md says to type for a webcam."""


def test_every_projection_is_tried() -> None:
    own = {name for name, model in camera_models().items() if model.__module__.startswith("omninav.")}
    assert own == set(FILES)
    assert {name for name in own if camera_models()[name].of_size(64, 32) is not None} == set(NAMES)


@pytest.fixture
def words(tmp_path: Path, request: pytest.FixtureRequest) -> list[str]:
    """`log=` and `camera=` for three images that such a camera may take."""
    name, _, suffix = request.param.partition(".")
    strip = FILES[name]["image"] == STRIP["image"]
    (tmp_path / "images").mkdir()
    for number in range(3):
        size = (160, 80 if strip else 120)
        radii = (200.0, 0.0) if strip or name == "perspective" else (58.0, 9.0)
        picture = ring_picture(((size[0] - 1) / 2, (size[1] - 1) / 2), *radii, number, size)
        cv2.imwrite(str(tmp_path / f"images/{number}.png"), picture)
    camera = name
    if suffix:
        camera = str(tmp_path / "camera.yaml")
        lines = [f"projection: {name}", *(f"{key}: {value}" for key, value in FILES[name].items())]
        (tmp_path / "camera.yaml").write_text("\n".join(lines))
    return [f"log={tmp_path / 'images'}", f"camera={camera}"]


@pytest.mark.parametrize("words", CAMERAS, indirect=True)
def test_every_camera_is_looked_through(
    words: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str], request: pytest.FixtureRequest
) -> None:
    out = tmp_path / "look.png"
    assert main(["camera", "look", *words, f"out={out}", "frame=1"]) == 0
    name = request.node.callspec.params["words"].removesuffix(".yaml")
    assert f"image 1, {name} camera" in capsys.readouterr().out
    assert np.ptp(cv2.imread(str(out))) > 200
    assert not list(tmp_path.glob("runs*"))


@pytest.mark.parametrize(("words", "variant"), USES, indirect=["words"])
def test_what_check_says_of_a_camera_is_what_the_run_does(
    words: list[str], variant: str, tmp_path: Path, shared_cache: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    tour = words[0].replace("log=", "tour=")
    line = [f"variant={variant}", *words, tour, f"cache={shared_cache}", f"runs={tmp_path / 'runs'}", "plots=none"]
    line += [] if variant == "topological_localisation" else ["speed=0.5"]
    if words[1] == "camera=perspective":
        assert main(["check", *line]) == 2
        assert "does not see the full circle, so that it makes no panorama; type" in capsys.readouterr().err
        line += ORDINARY[: 1 if variant == "topological_localisation" else 2]
        line += [] if variant == "topological_localisation" else ["features=haar_integral", "match=retrieval"]
    assert main(["check", *line]) == 0, capsys.readouterr().err
    assert main(line) == 0, capsys.readouterr().err


@pytest.mark.parametrize(
    "variant", [*VARIANTS, "retrieval_mcl", "particle_cml_baseline", "omniview_cml", "particle_cml"]
)
def test_a_mirror_of_which_nothing_is_known_serves_every_localiser(
    variant: str, tmp_path: Path, shared_cache: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    inputs = [f"log={DRIVE}"] if variant in ("omniview_cml", "particle_cml") else [f"tour={TOUR}", f"log={DRIVE}"]
    inputs += [f"grid={GRID}"] if variant == "retrieval_mcl" else []
    line = [f"variant={variant}", *inputs, "camera=donut", "plots=none", f"cache={shared_cache}", f"runs={tmp_path}"]
    line += ["nodes.source.stop=6"]
    assert main(["check", *line]) == 0, capsys.readouterr().err
    assert main(line) == 0, capsys.readouterr().err
    said = capsys.readouterr().err
    assert "its mirror's ring is the one in image 0, around column 140 and row 105, from 17 to 103 px" in said


@needs_data
@pytest.mark.parametrize("folder", ["catadioptric-calibration/omnidir_images", "catadioptric-alvin-robot"])
def test_real_mirrors_are_looked_through_without_a_camera_file(
    folder: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "look.png"
    assert main(["camera", "look", f"log={DATA / folder}", "camera=donut", f"out={out}"]) == 0
    assert "its mirror's ring is the one in image 0, around column" in capsys.readouterr().out
    assert out.is_file()


def test_a_donut_is_refused_where_no_ring_stands_out(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for number in range(2):
        noise = np.random.default_rng(number).integers(0, 256, (120, 160, 3), dtype=np.uint8)
        cv2.imwrite(str(tmp_path / f"{number}.png"), noise)
    assert main(["camera", "look", f"log={tmp_path}", "camera=donut"]) == 2
    assert "no ring of a mirror is found in its first 2 images; is it another camera (camera=…)? If not, give" in (
        capsys.readouterr().err
    )


OWN_CAMERA = '''"""A lens of mine."""

import numpy as np

from omninav.stages.camera.fisheye import Fisheye


class Squeezed(Fisheye, projection="NAME"):
    """A fisheye lens whose images are squeezed."""

    def project(self, rays):
        pixels, shown = super().project(rays)
        return pixels * np.array([1.0, 0.5]), shown
'''


@pytest.mark.parametrize("way", ["file", "package"])
def test_a_camera_model_of_a_third_party_is_used_by_name(
    omninav: Command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, way: str
) -> None:
    name = f"squeezed_{way}"  # classes of an earlier test are still known
    site = tmp_path / "site"
    info = site / "squeezed_camera-1.0.dist-info"
    info.mkdir(parents=True)
    (site / "squeezed_camera.py").write_text(OWN_CAMERA.replace("NAME", name))
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: squeezed-camera\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(f"[omninav.stages]\ncamera.{name} = squeezed_camera:Squeezed\n")
    file = "".join(f"{key}: {value}\n" for key, value in FILES["fisheye"].items())
    (tmp_path / "mine.yaml").write_text(f"projection: {name}\n{file}")
    (tmp_path / "drive").mkdir()
    for number in range(3):
        pixels = np.random.default_rng(number).integers(0, 256, (120, 160, 3), dtype=np.uint8)
        cv2.imwrite(str(tmp_path / "drive" / f"{number}.png"), pixels)
    if way == "package":
        monkeypatch.syspath_prepend(site)
    else:
        monkeypatch.setenv("OMNINAV_STAGES", f"camera.{name}=site/squeezed_camera.py:Squeezed")
    words = ("log=drive", "camera=mine.yaml")
    assert f"image 0, {name} camera" in omninav("camera", "look", *words, check=True).stdout
    checked = omninav("check", "variant=topological_localisation", "tour=drive", *words, check=True)
    assert "nothing wrong" in checked.stdout
    listed = omninav("stages", f"camera.{name}", check=True).stdout
    assert "A fisheye lens whose images are squeezed." in listed
    assert way == "file" or "    field  focal_px: float" in listed


def test_a_camera_model_that_cannot_be_imported_is_named_where_another_is_missing(
    omninav: Command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "broken.py").write_text("import not_there\n")
    (tmp_path / "mine.yaml").write_text("projection: stretched\n")
    monkeypatch.setenv("OMNINAV_STAGES", "camera.broken=broken.py:Lens")
    refused = omninav("camera", "look", f"log={DRIVE}", "camera=mine.yaml")
    assert refused.returncode == 2
    assert "'projection' cannot be 'stretched'; one of cylindrical, " in refused.stderr
    assert "; a model of your own is named in OMNINAV_STAGES, or installed" in refused.stderr
    assert "camera.broken: module 'broken.py' cannot be imported" in refused.stderr
    assert "broken.py' cannot be imported, line " in refused.stderr


def test_a_setting_that_a_tool_does_not_take_is_one_problem(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["camera", "look", f"log={DRIVE}", "unwarp=panorama"]) == 2
    said = capsys.readouterr().err
    assert "1 problem:\n  unwarp: LookThroughCamera has no parameter 'unwarp'" in said
    assert "parameters: camera, frame, log, out, topics" in said

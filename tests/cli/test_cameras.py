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
    "ocamcalib": DISC
    | {"centre": "{x: 79.5, y: 59.5}", "ocamcalib": "{polynomial: [-40, 0, 0.008], c: 1, d: 0, e: 0, looks: down}"},
    "dual_fisheye": STRIP
    | {
        "focal_px": "24",
        "ahead": "{x: 39.5, y: 39.5}",
        "back": "{x: 119.5, y: 39.5}",
        "mask": "{outer_radius_px: 39}",
    },
    "perspective": DISC,
}
"""The keys of a camera.yaml of each projection, for images of one of two sizes."""
NAMES = ("equirectangular", "dual_fisheye", "fisheye", "perspective", "donut")
"""Projections that need no file."""
CAMERAS = [*NAMES, *(f"{name}.yaml" for name in FILES)]
VARIANTS = ("omninav", "omniview_mcl", "plain_matching", "topological_localisation")
USES = [(camera, variant) for camera in NAMES for variant in VARIANTS] + [
    (f"{name}.yaml", VARIANTS[2]) for name in FILES
]
"""Pairs of camera and variant that are run: a camera file is tried with one variant, since all read it in one way."""
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
def test_every_camera_is_looked_through(words: list[str], tmp_path: Path) -> None:
    out = tmp_path / "look.png"
    assert main(["camera", "look", *words, f"out={out}"]) == 0
    assert np.ptp(cv2.imread(str(out))) > 200


@pytest.mark.parametrize(("words", "variant"), USES, indirect=["words"])
def test_what_check_says_of_a_camera_is_what_the_run_does(
    words: list[str], variant: str, tmp_path: Path, shared_cache: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    tour = words[0].replace("log=", "tour=")
    line = [f"variant={variant}", *words, tour, f"cache={shared_cache}", f"runs={tmp_path / 'runs'}", "plots=none"]
    line += [] if variant == "topological_localisation" else ["speed=0.5"]
    if "perspective" in words[1] or "projection: perspective" in _text(words[1]):
        assert main(["check", *line]) == 2
        assert "does not see the full circle, so that it makes no panorama; type" in capsys.readouterr().err
        line += ORDINARY[: 1 if variant == "topological_localisation" else 2]
        line += [] if variant == "topological_localisation" else ["features=haar_integral"]
        if variant in ("omninav", "omniview_mcl", "plain_matching"):
            line += ["match=retrieval"]
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
    assert "no ring of a mirror stands out in its first 2 images; is it another camera (camera=…)? If not, give" in (
        capsys.readouterr().err
    )


OWN_CAMERA = '''"""A lens of mine."""

import numpy as np

from omninav.stages.camera.fisheye import Fisheye


class Squeezed(Fisheye, projection="squeezed"):
    """A fisheye lens whose images are squeezed."""

    def project(self, rays):
        pixels, shown = super().project(rays)
        return pixels * np.array([1.0, 0.5]), shown
'''


@pytest.mark.parametrize("way", ["file", "package"])
def test_a_camera_model_of_a_third_party_is_used_by_name(omninav_process: Command, tmp_path: Path, way: str) -> None:
    site = tmp_path / "site"
    info = site / "squeezed_camera-1.0.dist-info"
    info.mkdir(parents=True)
    (site / "squeezed_camera.py").write_text(OWN_CAMERA)
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: squeezed-camera\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text("[omninav.stages]\ncamera.squeezed = squeezed_camera:Squeezed\n")
    named = {"OMNINAV_STAGES": "camera.squeezed=site/squeezed_camera.py:Squeezed"}
    settings = named if way == "file" else {"PYTHONPATH": str(site)}
    file = "".join(f"{key}: {value}\n" for key, value in FILES["fisheye"].items())
    (tmp_path / "mine.yaml").write_text(f"projection: squeezed\n{file}")
    (tmp_path / "broken.py").write_text("import not_there\n")
    for number in range(3):
        pixels = np.random.default_rng(number).integers(0, 256, (120, 160, 3), dtype=np.uint8)
        (tmp_path / "drive").mkdir(exist_ok=True)
        cv2.imwrite(str(tmp_path / "drive" / f"{number}.png"), pixels)
    words = ("log=drive", "camera=mine.yaml")
    looked = omninav_process("camera", "look", *words, check=True, **settings)
    assert "image 0, squeezed camera" in looked.stdout
    if way == "package":
        return
    refused = omninav_process("camera", "look", *words, OMNINAV_STAGES="camera.broken=broken.py:Lens")
    assert refused.returncode == 2
    assert "'projection' cannot be 'squeezed'" in refused.stderr
    assert "camera.broken: module 'broken.py' cannot be imported" in refused.stderr
    checked = omninav_process("check", "variant=topological_localisation", "tour=drive", *words, check=True, **settings)
    assert "nothing wrong" in checked.stdout
    listed = omninav_process("stages", "camera.squeezed", check=True, **settings).stdout
    assert "camera.squeezed" in listed
    assert "A fisheye lens whose images are squeezed." in listed


def test_a_setting_that_a_tool_does_not_take_is_one_problem(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["camera", "look", f"log={DRIVE}", "unwarp=panorama"]) == 2
    said = capsys.readouterr().err
    assert "1 problem:\n  unwarp: LookThroughCamera has no parameter 'unwarp'" in said
    assert "parameters: camera, frame, log, out, topics" in said


def _text(word: str) -> str:
    file = Path(word.partition("=")[2])
    return file.read_text() if file.is_file() else ""

"""camera.yaml: read, written back, and refused by key."""

import dataclasses
from contextlib import nullcontext
from pathlib import Path

import numpy as np
import pytest
import yaml

from omninav.pipeline.mcap.message_types import make_message
from omninav.stages.camera.cylindrical import Cylindrical
from omninav.stages.camera.donut import Donut
from omninav.stages.camera.equirectangular import Equirectangular
from omninav.stages.camera.fisheye import Fisheye
from omninav.stages.camera.hyperbolic import HyperbolicMirror
from omninav.stages.camera.model import Camera
from omninav.stages.camera.perspective import Perspective
from omninav.stages.recordings.camera_yaml import camera_from_info, parse_camera, read_camera, write_camera
from omninav.stages.recordings.named_camera import named_camera
from omninav.stages.recordings.recording import UnreadableRecording

from .conftest import refused

SIZE = {"width": 640, "height_px": 480}
PINHOLE = {"focal_x": 497.0, "focal_y": 496.0, "centre_x": 319.5, "centre_y": 239.5, "skew": 0.1}
CAMERAS = [
    HyperbolicMirror(
        **SIZE, **PINHOLE, a=28.095, b=23.4125, inner_radius_px=34, outer_radius_px=238, height=0.9, yaw=0.3
    ),
    Donut(**SIZE),
    Donut(
        **SIZE, centre_x=320, centre_y=240, inner_radius_px=30, outer_radius_px=230, sense="counter_clockwise", yaw=1
    ),
    Cylindrical(**SIZE, column_of_forward=320),
    Cylindrical(
        **SIZE, column_of_forward=3, sense="counter_clockwise", height=1, elevation_top=0.4, elevation_bottom=-1
    ),
    Equirectangular(**SIZE, column_of_forward=320, elevation_top=1.5, elevation_bottom=-1.5),
    Fisheye(**SIZE, focal_px=150, centre_x=320, centre_y=240, outer_radius_px=235, inner_radius_px=3, yaw=-1),
    Perspective(**SIZE, **PINHOLE, height=0.4, yaw=0.1, position_x=0.3, position_y=-0.1),
]
HOUSE = write_camera(CAMERAS[0])


@pytest.mark.parametrize("camera", CAMERAS, ids=lambda camera: type(camera).__name__)
def test_a_camera_that_is_written_reads_back_the_same(camera: Camera) -> None:
    back = parse_camera(write_camera(camera), "camera.yaml")
    assert type(back) is type(camera)
    assert dataclasses.asdict(back) == dataclasses.asdict(camera)


@pytest.mark.parametrize("key", ["projection", "K", "mirror", "mask", "image"])
def test_a_missing_key_is_named_with_its_file(key: str) -> None:
    content = yaml.safe_load(HOUSE)
    del content[key]
    with pytest.raises(UnreadableRecording, match=rf"robot/camera\.yaml: key '{key}' is missing"):
        parse_camera(yaml.safe_dump(content), "robot/camera.yaml")


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("  a: 28.095", "  aa: 28.095", r"key 'mirror\.a' is missing; is 'mirror\.aa' meant to be 'mirror\.a'\?"),
        ("a: 28.095", "a: long", r"'mirror\.a': 'long' \(str\), expected float >= 1e-05"),
        ("a: 28.095", "a: -1", r"'mirror\.a': -1\.0 is out of bounds, expected float >= 1e-05"),
        ("a: 28.095", "a: 1.0e-300", r"'mirror\.a': 1e-300 is out of bounds"),
        ("yaw: 0.3", "yaw: 90.0", r"'yaw': 90\.0 is out of bounds, expected float >= -6\.28319 and <= 6\.28319"),
        ("\nheight: ", "\nheight: -", r"'height': -0\.\d+ is out of bounds, expected float >= 0"),
        ("\nheight: ", "\nheight: 9", r"'height': 90\.9.* expected float >= 0 and <= 10, in metres above the floor"),
        ("- 319.5", "- 0.0", r"the ring around \(0, 239\.5\) an image of 640 x 480 shows 5\d % of all azimuths"),
        ("497.0", "1.0e-300", "with focal lengths of a pixel or more"),
        ("497.0", "900000.0", "% of all directions; check the model, the mask and the size"),
        (
            "outer_radius_px: ",
            "outer_radius_px: 50",
            r"the mask \(34 to 50\d+ px\) reaches beyond what this hyperbolic",
        ),
        ("inner_radius_px: 34", "inner_radius_px: 237.99", "sees 0 % of all directions"),
        ("a: 28.095", "a: {b: 1}", r"'mirror\.a' must be a number or a word, not a dict"),
        ("yaw: 0.3", "yaw: .nan", "line \\d+: '.nan' is not finite"),
        ("hyperbolic", "hyperbolik", "'projection' cannot be 'hyperbolik'; did you mean 'hyperbolic'"),
        ("yaw:", "yaww:", "key 'yaww' is not known; did you mean 'yaw'"),
        ("inner_radius_px: 34", "inner_radius_px: 340", "must be below"),
        ("  width: 640", "  width: [", "not valid YAML"),
        ("497.0", "0", "'K' must be"),
        ("- - 0.0\n  - 0.0\n  - 1.0", "- - 319.5\n  - 239.5\n  - 1.0", r"'K' must be \[\[fx"),
    ],
)
def test_a_wrong_key_is_named_with_what_to_write(old: str, new: str, said: str) -> None:
    assert old in HOUSE
    with refused(said):
        parse_camera(HOUSE.replace(old, new, 1), "camera.yaml")


@pytest.mark.parametrize(
    ("x", "y", "said"),
    [
        (639.0, 479.0, r"the centre \(639, 479\) of an image of 640 x 480 is that of one 2 times as large"),
        (160.0, 120.0, "is that of one 0.5 times as large; give centre and focal lengths of its size"),
        (239.5, 319.5, r"has its column and row exchanged: expected \(319\.5, 239\.5\)"),
        (350.0, 200.0, ""),
    ],
)
def test_a_centre_of_another_image_or_exchanged_is_refused(x: float, y: float, said: str) -> None:
    content = {
        "projection": "perspective", "image": {"width": 640, "height": 480}, "height": 0.9,
        "K": [[497.0, 0.0, x], [0.0, 497.0, y], [0.0, 0.0, 1.0]],
    }  # fmt: skip
    with refused(said) if said else nullcontext():
        parse_camera(yaml.safe_dump(content), "camera.yaml")


@pytest.mark.parametrize(
    "text",
    [
        "projection: [hyperbolic]",
        "width: !!timestamp nonsense",
        "when: 2000-99-01",
        f"width: {'9' * 5000}",
        "a: &a [x, x]\nb: &b [*a, *a]\nprojection: hyperbolic\nK: *b\nimage: {width: 6, height: *b}",
        "- projection",
        "projection: \0",
        b"\xff\xfe\x00",
        "[" * 5000,
        "? {a: 1}\n: b",
        "a: &a *a",
        "a: &a {b: c}\n<<: [*a, 3]",
        "projection: donut\nimage: {width: 40000, height: 1}",
        "projection: donut\nimage: {width: 20000, height: 20000}",
        "projection: perspective\nimage: {width: 6, height: 6}\nK: [nan, 0, 1, 0, 1, 1, 0, 0, 1]",
        "projection: donut\nprojection: donut\nimage: {width: 6, height: 6}",
        "x" * 2_000_000,
    ],
)
def test_a_hostile_file_is_refused_in_one_short_line(text: str | bytes) -> None:
    with refused(r"^camera\.yaml(, line \d+(, column \d+)?)?: .{,270}$"):
        parse_camera(text, "camera.yaml")


def test_remarks_in_an_attached_camera_file_do_no_harm_and_a_file_of_its_own_has_them_behind_a_sign(
    tmp_path: Path,
) -> None:
    assert parse_camera(HOUSE + "serial_number: 7\n", "camera.yaml").width == 640
    file = tmp_path / "camera.yaml"
    file.write_text(HOUSE + "# serial number 7\ncolumn_of_forward: 3  # of another model\n")
    assert read_camera(file).width == 640
    file.write_text(HOUSE + "tilt_deg: 3\n")
    with refused(r"camera\.yaml: key 'tilt_deg' is not known; keys: K, .*, yaw; remarks begin with #"):
        read_camera(file)


def info(model: str, d: list[float]) -> object:
    k = [497.0, 0, 319.5, 0, 496.0, 239.5, 0, 0, 1]
    return make_message(
        "sensor_msgs/msg/CameraInfo", {"width": 640, "height": 480, "distortion_model": model, "k": k, "d": d}
    )


def test_camera_info_stands_in_for_a_missing_camera_file() -> None:
    mirror = camera_from_info(info("hyperbolic_mirror", [28.095, 23.4125]), "log.mcap")
    assert isinstance(mirror, HyperbolicMirror)
    assert (mirror.a, mirror.b, mirror.focal_y, mirror.outer_radius_px) == (28.095, 23.4125, 496.0, 239.5)
    assert isinstance(camera_from_info(info("plumb_bob", [0.0] * 5), "log.mcap"), Perspective)
    with pytest.raises(UnreadableRecording, match="give camera="):
        camera_from_info(info("plumb_bob", [0.1] * 5), "log.mcap")


def test_a_projection_comes_before_a_file_of_its_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "donut").write_text("not a camera")
    monkeypatch.chdir(tmp_path)
    camera, files = named_camera("donut", lambda: (640, 640))
    assert isinstance(camera, Donut)
    assert files == []


def test_a_full_panorama_of_mirror_images_is_refused_and_a_strip_is_not() -> None:
    with refused("images of 640 x 480 are no equirectangular ones, twice as wide as high"):
        named_camera("equirectangular", lambda: (640, 480))
    assert named_camera("equirectangular", lambda: (720, 144))[0].elevations == pytest.approx(
        (0.2 * np.pi, -0.2 * np.pi)
    )

"""Public data sets as they are downloaded, in miniature, read with the layouts that come with omninav."""

import json
import math
import os
import shlex
from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt
import pytest
from made_rings import ring_picture
from scipy.spatial.transform import Rotation

from omninav.stages.geometry.plane.se2 import wrap
from omninav.stages.recordings.description import known_layouts, read_description
from omninav.stages.recordings.opening import open_recording
from omninav.stages.recordings.recording import Recording
from omninav.stages.recordings.tables import read_table

from .conftest import refused

HEADINGS = np.radians([-170.0, -91.3, 0.0, 12.7, 88.8, 179.9])
"""True headings of the frames, counter-clockwise from x."""
X, Y = np.linspace(1.0, 2.5, 6), np.linspace(-3.0, -2.0, 6)
CAMERA_TO_ROBOT = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
"""Columns: a camera's axes (right, down, ahead) in the robot's frame (ahead, left, up)."""


def turns(mount: npt.ArrayLike, tilt_deg: float = 4.0) -> npt.NDArray[np.float64]:
    """World from body (6, 3, 3) at the true headings, each slightly pitched and rolled, of a body that is mounted so.

    Pitch and roll in this order leave the heading of what is ahead as it is.
    """
    angles = np.column_stack([HEADINGS, np.full(6, math.radians(tilt_deg)), np.full(6, math.radians(-tilt_deg))])
    found: npt.NDArray[np.float64] = Rotation.from_euler("ZYX", angles).as_matrix() @ np.asarray(mount)
    return found


def assert_poses(recording: Recording) -> None:
    assert recording.truth is not None
    np.testing.assert_allclose(recording.truth[:, :2], np.column_stack([X, Y]), atol=1e-3)
    assert np.degrees(abs(wrap(recording.truth[:, 2] - HEADINGS))).max() < 0.1


def write_images(paths: list[Path], size: tuple[int, int] = (64, 32)) -> None:
    for number, path in enumerate(paths):
        path.parent.mkdir(parents=True, exist_ok=True)
        few = np.random.default_rng(number).integers(0, 256, (8, 16, 3), dtype=np.uint8)
        assert cv2.imwrite(str(path), cv2.resize(few, size, interpolation=cv2.INTER_NEAREST))


def cold(folder: Path) -> str:
    (folder / "omni_cam").mkdir(parents=True)
    for number, (x, y, heading) in enumerate(zip(X, Y, HEADINGS, strict=True)):
        name = f"t{1152876365.612317 + 0.2 * number:.6f}_x{x:.6f}_y{y:.6f}_a{heading:.6f}.jpeg"
        cv2.imwrite(str(folder / "omni_cam" / name), ring_picture((330, 236), 200, 40, seed=number))
    write_images([folder / "std_cam" / path.name for path in (folder / "omni_cam").iterdir()])
    return f"cold:{folder}"


def loc360(folder: Path) -> str:
    poses = np.tile(np.eye(4), (6, 1, 1))
    poses[:, :3, :3], poses[:, 0, 3], poses[:, 1, 3] = turns(CAMERA_TO_ROBOT), X, Y
    names = [f"{number:04d}.jpg" for number in (0, 1, 2, 5, 6, 12)]
    write_images([folder / "image" / name for name in names])
    (folder / "camera_pose.json").write_text(json.dumps(dict(zip(names, poses.tolist(), strict=True))))
    return f"loc360:{folder}"


def kitti360(folder: Path) -> str:
    drive, numbers = "2013_05_28_drive_0000_sync", (1, 2, 3, 7, 8, 4390)
    for camera in ("image_02", "image_03"):
        images = folder / "data_2d_raw" / drive / camera / "data_rgb"
        write_images([images / f"{number:010}.png" for number in (0, *numbers)], (1400, 1400))
    poses = np.concatenate([turns(np.diag([1.0, -1.0, -1.0])), np.stack([X, Y, 0 * X], axis=1)[..., None]], axis=2)
    rows = [f"{n} " + " ".join(f"{cell:.10f}" for cell in pose.ravel()) for n, pose in zip(numbers, poses, strict=True)]
    (folder / "data_poses" / drive).mkdir(parents=True)
    (folder / "data_poses" / drive / "poses.txt").write_text(" \n".join(rows) + " \n")
    return f"kitti360:{folder}:0000"


def tum(folder: Path) -> str:
    stamps = np.round(1305031102.1753 + np.arange(6) / 30, 4)
    write_images([folder / "rgb" / f"{stamp:.6f}.png" for stamp in stamps])
    head = "# color images\n# file: 'rgbd_dataset_freiburg1_xyz.bag'\n# timestamp filename\n"
    (folder / "rgb.txt").write_text(head + "".join(f"{stamp:.6f} rgb/{stamp:.6f}.png\n" for stamp in stamps))
    quaternions = Rotation.from_matrix(turns(CAMERA_TO_ROBOT)).as_quat()
    rows = np.column_stack([X, Y, 0 * X + 1.7, quaternions])
    lines = [f"{stamp:.4f} " + " ".join(f"{cell:.4f}" for cell in row) for stamp, row in zip(stamps, rows, strict=True)]
    head = "# ground truth trajectory\n# timestamp tx ty tz qx qy qz qw\n"
    (folder / "groundtruth.txt").write_text(head + "\n".join(lines) + "\n")
    return f"tum:{folder}"


def euroc(folder: Path) -> str:
    stamps = 1403636579763555584 + 50_000_000 * np.arange(6)
    images, truth = folder / "mav0" / "cam0", folder / "mav0" / "state_groundtruth_estimate0"
    write_images([images / "data" / f"{stamp}.png" for stamp in stamps])
    (images / "data.csv").write_text(
        "#timestamp [ns],filename\r\n" + "".join(f"{s},{s}.png\r\n" for s in stamps.tolist())
    )
    truth.mkdir()
    imu = np.array([[0.0, 0.0, 1.0], [0.0, -1.0, 0.0], [1.0, 0.0, 0.0]])  # x up, z ahead
    quaternions = np.roll(Rotation.from_matrix(turns(imu)).as_quat(), 1, axis=1)
    rows = np.column_stack([X, Y, 0 * X, quaternions, np.zeros((6, 9))])
    lines = [f"{s}," + ",".join(f"{cell:.6f}" for cell in row) for s, row in zip(stamps.tolist(), rows, strict=True)]
    head = "#timestamp, p_RS_R_x [m], p_RS_R_y [m], p_RS_R_z [m], q_RS_w [], q_RS_x [], q_RS_y [], q_RS_z [], v_RS_R_x"
    (truth / "data.csv").write_text("\n".join([head, *lines]))
    return f"euroc:{folder}"


def sussex_campus(folder: Path) -> str:
    write_images([folder / f"image{number}.jpg" for number in range(6)], (90, 25))
    head = "Timestamp [ms],X [mm],Y [mm],Z [mm],Heading [degrees],Pitch [degrees],Roll [degrees],Filename,GPS quality"
    compass = np.degrees(math.pi / 2 - HEADINGS) % 360.0
    lines = [
        f"{200 * n + 2.413907},{x * 1000},{y * 1000},56600.0,{angle},-1.2,7.6,image{n}.jpg,4"
        for n, (x, y, angle) in enumerate(zip(X, Y, compass, strict=True))
    ]
    (folder / "database_entries.csv").write_text("\n".join([head, *lines]))
    return f"sussex_campus:{folder}"


DATA_SETS = (cold, loc360, kitti360, tum, euroc, sussex_campus)


@pytest.mark.parametrize("data_set", DATA_SETS)
def test_poses_of_a_public_data_set_are_read_by_its_layout(tmp_path: Path, data_set) -> None:
    recording = open_recording(data_set(tmp_path / "data"))
    assert_poses(recording)
    assert recording.image(5) is not None
    assert not recording.dropped


def test_numbers_with_gaps_become_times_with_gaps(tmp_path: Path) -> None:
    assert (open_recording(kitti360(tmp_path)).stamps // 10**8).tolist() == [1, 2, 3, 7, 8, 4390]
    (tmp_path / "b").mkdir()
    assert (open_recording(loc360(tmp_path / "b")).stamps // 10**9).tolist() == [0, 1, 2, 5, 6, 12]


def test_two_fisheyes_lie_side_by_side_and_look_left_and_right(tmp_path: Path) -> None:
    recording = open_recording(kitti360(tmp_path))
    files = sorted(tmp_path.glob("data_2d_raw/*/image_0[23]/data_rgb/0000000007.png"))
    np.testing.assert_array_equal(recording.image(3), np.hstack([cv2.imread(str(file)) for file in files]))
    files[1].unlink()
    assert open_recording(f"kitti360:{tmp_path}:0000").dropped == {"missing_image": 1}
    looks = recording.camera.unproject(np.array([[716.9, 705.8], [2098.9, 698.1]]))[0]
    np.testing.assert_allclose(looks, [[0.0, 1.0, 0.0], [0.0, -1.0, 0.0]], atol=1e-4)


def test_the_other_camera_of_a_data_set_is_named_behind_its_folder(tmp_path: Path) -> None:
    recording = open_recording(f"{cold(tmp_path)}:std_cam", camera="perspective")
    assert (recording.camera.projection, recording.camera.width) == ("perspective", 64)
    assert_poses(recording)


@pytest.mark.parametrize(
    ("data_set", "file", "old", "new", "said"),
    [
        (loc360, "camera_pose.json", "[[", "[[[", r"camera_pose\.json: expected an object of names and matrices"),
        (loc360, "camera_pose.json", '{"0000', '{"x', r"line 6: 'x\.jpg' has no number"),
        (kitti360, "data_poses/*/poses.txt", "\n2 ", "\ntwo ", r"poses\.txt, line 2: 'two' has no number"),
        (kitti360, "data_poses/*/poses.txt", "0.", "7.", r"poses\.txt, line 1: .*\(-7.* a rotation matrix"),
        (tum, "groundtruth.txt", "1.7000", "1.7000 0.1", r"groundtruth\.txt, line 3: .* a unit quaternion"),
        (euroc, "mav0/state*/data.csv", "0.000000,", "0.000000,none,", r"data\.csv, line 2: .*no number"),
        (sussex_campus, "database_entries.csv", "Filename", "File", r"no column 'Filename'; did you mean 'File'"),
    ],
)  # fmt: skip
def test_a_malformed_row_is_named(tmp_path: Path, data_set, file: str, old: str, new: str, said: str) -> None:
    log = data_set(tmp_path / "data")
    (path,) = (tmp_path / "data").glob(file)
    assert old in path.read_text()
    path.write_text(path.read_text().replace(old, new))
    with refused(said):
        open_recording(log)


@pytest.mark.parametrize("stray", [b"thumbnail.jpeg", b"t_x_y_a.jpeg", b"t1_x\xff_y2_a3.jpeg"])
def test_a_name_of_another_form_is_refused(tmp_path: Path, stray: bytes) -> None:
    log = cold(tmp_path)
    (tmp_path / "omni_cam" / os.fsdecode(stray)).write_bytes(b"x")
    with refused(r"the image's name '\w.*\.jpeg' is not of the form 't\{time\}_x\{x\}"):
        open_recording(log)


@pytest.mark.parametrize("form", ["x{x}_t{time}", "t{time}_x{x}"])
def test_images_come_in_the_order_of_the_times_in_their_names(tmp_path: Path, form: str) -> None:
    (tmp_path / "recording.yaml").write_text(
        f"frames: {{images: '*.png', name: '{form}', time: {{column: time, unit: s}}}}\n"
        "positions: {x: {column: x, unit: m}, y: {column: time, unit: m}}\ncamera: equirectangular"
    )
    times = ("1.5", "1.75", "2", "2.25")
    write_images([tmp_path / f"{form.format(x=9 - n, time=time)}.png" for n, time in enumerate(times)])
    recording = open_recording(str(tmp_path))
    assert not recording.dropped
    assert (recording.stamps / 1e9).tolist() == [float(time) for time in times]
    assert recording.truth is not None
    assert recording.truth[:, 0].tolist() == [9.0, 8.0, 7.0, 6.0]
    np.testing.assert_array_equal(
        recording.image(3), cv2.imread(str(tmp_path / f"{form.format(x=6, time='2.25')}.png"))
    )


def test_names_in_a_json_come_in_the_order_of_their_numbers_and_without_a_header(tmp_path: Path) -> None:
    log = loc360(tmp_path)
    pose = json.loads((tmp_path / "camera_pose.json").read_text())["0000.jpg"]
    names = [f"{number}.jpg" for number in range(12)]
    write_images([tmp_path / "image" / name for name in names])
    (tmp_path / "camera_pose.json").write_text(json.dumps(dict.fromkeys(names, pose)))
    assert read_description(known_layouts()["loc360"]).frames.header
    recording = open_recording(log)
    assert (recording.stamps // 10**9).tolist() == list(range(12))
    assert not recording.dropped


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ("[0]", "found a list"),
        ("[1, 2, 3]", "found a list"),
        ("7", "found a int"),
        ('{"a": [1' + 400 * "0" + "]}", r"json, 'a': expected an object of names and matrices"),
        (r'{"\ud800": [1]}', "surrogates not allowed"),
        ('{"a": {"x": 1}}', "json, 'a': expected"),
        ('{"a": [' + "0," * 700_000 + "0]}", "found 700,001 numbers"),
        ("{" + ",".join(f'"{n}":1' for n in range(50_001)) + "}", "found 50,001 names"),
        ('{"a": [' + " " * 4_000_000 + "0]}", "more than 4,000,000 bytes"),
    ],
)
def test_a_hostile_json_is_one_short_line(tmp_path: Path, content: str, said: str) -> None:
    (tmp_path / "poses.json").write_text(content)
    with refused(said):
        read_table(tmp_path / "poses.json")


def test_a_row_without_a_rotation_has_no_heading(tmp_path: Path) -> None:
    log = tum(tmp_path / "tum")
    truth = tmp_path / "tum" / "groundtruth.txt"
    lines = truth.read_text().splitlines()
    truth.write_text("\n".join([*lines[:4], " ".join([*lines[4].split()[:4], "0 0 0 0"]), *lines[5:]]))
    recording = open_recording(log)
    assert len(recording.stamps) == 6  # it is looked up between its neighbours
    log = kitti360(tmp_path / "kitti")
    (poses,) = (tmp_path / "kitti").glob("data_poses/*/poses.txt")
    poses.write_text(poses.read_text().replace("\n2 -0", "\n2 -7"))
    recording = open_recording(log)
    assert recording.dropped == {"no_position": 1}
    assert "line 2 (0000000002.png): no heading" in recording.details["no_position"]


def test_a_column_takes_the_place_of_a_rotation(tmp_path: Path) -> None:
    tum(tmp_path)
    (tmp_path / "mine.yaml").write_text("like: tum\nheading: {column: 4, unit: rad, rotation: []}\n")
    truth = open_recording(f"{tmp_path / 'mine.yaml'}:{tmp_path}").truth
    assert truth is not None
    np.testing.assert_allclose(truth[:, 2], np.loadtxt(tmp_path / "groundtruth.txt")[:, 4])


PAIRS = """
frames: {csv: images.csv, header: false, file: 0, right: {replace: left, by: right}, index: 1, period: 1.0}
camera: equirectangular
"""


def pairs(folder: Path, cells: str) -> list[Path]:
    """A folder with one pair of images, the left one by its absolute path, beside which the table has `cells`."""
    images = [folder.absolute() / side / "0.png" for side in ("left", "right")]
    write_images(images)
    (folder / "images.csv").write_text(f"{images[0]},{cells}\n")
    (folder / "recording.yaml").write_text(PAIRS)
    return images


def test_absolute_names_are_read_in_a_folder_named_relatively(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    images = pairs(Path("data"), "img_0001.jp2")
    recording = open_recording("data")
    assert recording.stamps.tolist() == [10**9]
    np.testing.assert_array_equal(recording.image(0), np.hstack([cv2.imread(str(image)) for image in images]))


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("replace: left", "replace: links", r"recording\.yaml: frames\.right finds no 'links' in 'left/0\.png'"),
        ("index: 1", "index: 2", "'00000000001' has a number of more than 10 digits"),
        ("period: 1.0", "time: {column: 1, unit: s}", "'index' counts periods in place of a 'time'"),
        ("csv: images.csv", "images: '*/*.png'", "'index' counts periods in place of a 'time' in a 'csv'"),
        ("camera: equirectangular", "camera: /etc/passwd", "camera: '/etc/passwd' is no projection: .*donut"),
    ],
)
def test_what_a_description_cannot_mean_is_refused(tmp_path: Path, old: str, new: str, said: str) -> None:
    pairs(tmp_path, "1,00000000001")
    assert old in PAIRS
    (tmp_path / "recording.yaml").write_text(PAIRS.replace(old, new))
    with refused(said):
        open_recording(str(tmp_path))


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ("heading: {forward: y}", "the axis y of its rotations is .* degrees from level"),
        ("heading: {rotation: [4, 5]}", "'rotation' has 2 columns, expected 4"),
        ("heading: {column: 4, unit: deg}", "has a 'column' and a 'rotation': leave out one"),
        ("heading: {column: 4, rotation: []}", "needs a 'column' and its 'unit', or a 'rotation'"),
        ("frames: {name: 't{x}{y}'}", "expected different {columns} with text between them"),
        ("frames: {name: 't{x}'}", "leave out 'csv'"),
    ],
)
def test_a_layout_that_does_not_fit_says_which_key(tmp_path: Path, changed: str, said: str) -> None:
    folder = tmp_path / "data"
    tum(folder)
    (tmp_path / "mine.yaml").write_text(f"like: tum\n{changed}\n")
    with refused(said):
        open_recording(f"{tmp_path / 'mine.yaml'}:{folder}")


def test_a_data_set_says_where_it_is_from_and_how_to_run_it() -> None:
    variants = {path.stem for path in (Path(__file__).parents[3] / "conf" / "variant").glob("*.yaml")}
    for name, path in known_layouts().items():
        about = read_description(path).about
        assert about is not None, name
        assert about.site.startswith("https://"), name
        words = dict(word.partition("=")[::2] for word in shlex.split(about.run))
        assert words["variant"] in variants, name
        assert words["log"].partition(":")[0] in known_layouts(), name

"""Folders of images with CSVs, by configuration alone."""

import math
import random
import textwrap
from decimal import Decimal
from pathlib import Path

import cv2
import numpy as np
import pytest
from conftest import DATA, needs_data
from made_logs import picture
from turned_views import columns_moved

from omninav.pipeline import Context
from omninav.stages.geometry.plane.se2 import wrap
from omninav.stages.recordings.opening import open_recording
from omninav.stages.recordings.positions import track_directions
from omninav.stages.recordings.recording import UnreadableRecording
from omninav.stages.recordings.tables import NO_TIME, Angle, Length, Time, read_table
from omninav.stages.source.log import LogSource
from omninav.stages.source.playback import PlaybackState
from omninav.stages.values.encoded_image import decode_image, orientation_of

from .conftest import refused

DESCRIPTION = """
frames:
  csv: frames.csv
  file: File
  rename: [{replace: "^.*/", by: "", regex: true}]
  images: pictures
  time: {column: Clock, unit: ms}
positions:
  csv: track.csv
  header: false
  delimiter: ";"
  time: {column: 0, unit: s}
  x: {column: 1, unit: in}
  y: {column: 2, unit: cm}
  clock_offset: 10.0
  offset_x: 5.0
heading: {column: 3, unit: deg, zero: y, sense: clockwise, offset: 0.1}
camera: {projection: cylindrical, column_of_forward: 8}
"""


def folder(tmp_path: Path, description: str = DESCRIPTION, skip: tuple[int, ...] = ()) -> Path:
    """Six pictures 100 ms apart; a track 10 s later by its own clock, from 10.05 to 10.45 s, in a line along x."""
    (tmp_path / "pictures").mkdir(exist_ok=True)
    rows = ["File , Clock"]
    for number in range(6):
        rows.append(f"/home/robot/p{number}.png, {number * 100}")
        if number not in skip:
            cv2.imwrite(str(tmp_path / "pictures" / f"p{number}.png"), picture(number)[:4, :16])
    (tmp_path / "frames.csv").write_text("\n".join(rows))
    track = [f"{10.05 + n * 0.1:.2f};{n};2.54 m;{20 * n} deg" for n in range(5)]
    (tmp_path / "track.csv").write_text("\n".join(track))
    (tmp_path / "recording.yaml").write_text(textwrap.dedent(description))
    return tmp_path


def test_columns_units_clock_and_heading_conventions_are_configuration(tmp_path: Path) -> None:
    recording = open_recording(str(folder(tmp_path)))
    assert recording.stamps.tolist() == [100_000_000, 200_000_000, 300_000_000, 400_000_000]
    assert recording.dropped == {"no_position": 2}  # the track covers 10.05 to 10.45 s
    halves = np.array([0.5, 1.5, 2.5, 3.5])  # pictures lie in the middle between two rows of the track
    np.testing.assert_allclose(recording.truth[:, 0], 5 + halves * 0.0254)
    np.testing.assert_allclose(recording.truth[:, 1], 2.54)
    np.testing.assert_allclose(recording.truth[:, 2], math.pi / 2 - np.radians(20 * halves) + 0.1)
    assert recording.odometry is None
    assert (recording.camera.width, recording.camera.height_px) == (16, 4)
    assert recording.image(0).shape == (4, 16, 3)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("p2.png, 200", 'p2.png, 200, "', r"frames\.csv, line 4: a quote is opened and not closed"),
        (" , ", ";", r"no column 'File'; write delimiter: \";\" beside csv:"),
    ],
)
def test_a_table_that_is_read_otherwise_than_it_was_meant_is_refused(
    tmp_path: Path, old: str, new: str, said: str
) -> None:
    table = folder(tmp_path) / "frames.csv"
    table.write_text(table.read_text().replace(old, new))
    with refused(said):
        open_recording(str(tmp_path))


def test_why_no_row_has_a_position_is_counted(tmp_path: Path) -> None:
    path = folder(tmp_path)
    (path / "track.csv").write_text("10;1;1;0\n10;2;1;0\nnoon;3;1;0\n11;north;1;0")
    with pytest.raises(UnreadableRecording, match=r"its 4 rows have a position: 1 have no time, 1 no number .*, 1 a"):
        open_recording(str(path))


def test_times_before_zero_are_refused(tmp_path: Path) -> None:
    path = folder(tmp_path, DESCRIPTION.replace("clock_offset: 10.0", "clock_offset: 10.5"))
    (path / "frames.csv").write_text("\n".join(["File,Clock", *(f"p{n}.png,{100 * n - 500}" for n in range(6))]))
    with pytest.raises(UnreadableRecording, match=r"its first image is of -0\.\d+ s, expected times from 0 on"):
        open_recording(str(path))


def test_a_position_that_no_robot_reaches_is_dropped_and_counted(tmp_path: Path) -> None:
    path = folder(tmp_path)
    (path / "track.csv").write_text((path / "track.csv").read_text().replace("10.25;2;", "10.25;900;"))
    recording = open_recording(str(path))
    assert recording.dropped == {"no_position": 2, "impossible_motion": 1}
    np.testing.assert_allclose(recording.truth[:, 0], 5 + np.array([0.5, 1.5, 2.5, 3.5]) * 0.0254)


def test_an_image_between_two_positions_that_no_robot_gets_between_has_none(tmp_path: Path) -> None:
    path = folder(tmp_path)
    track = [f"{9.05 + n * 0.1:.2f};{n + 900 * (n >= 12)};0;0" for n in range(25)]
    (path / "track.csv").write_text("\n".join(track))
    recording = open_recording(str(path))
    assert recording.dropped == {"no_position": 1}
    inches = np.array([9.5, 10.5, 912.5, 913.5, 914.5])
    np.testing.assert_allclose(recording.truth[:, 0], 5 + inches * 0.0254)


def test_images_without_a_clock_come_at_a_constant_rate(tmp_path: Path) -> None:
    description = """
    frames: {csv: frames.csv, file: 0, header: false, images: pictures, period: 0.5}
    positions: {x: {column: 1, unit: m}, y: {column: 2, unit: m}}
    tangent: {window: 0.5, unit: m}
    camera: {projection: cylindrical, column_of_forward: 8}
    """
    path = folder(tmp_path, description)
    (path / "frames.csv").write_text("".join(f"p{n}.png,{n},{n}\n" for n in range(6)))
    recording = open_recording(str(path))
    assert recording.stamps.tolist() == [round(n * 0.5e9) for n in range(6)]
    np.testing.assert_allclose(recording.truth[:, 2], math.pi / 4)


def test_a_layout_from_a_users_folder_may_change_another(tmp_path: Path) -> None:
    layouts = tmp_path / "layouts"
    layouts.mkdir()
    (layouts / "mine.yaml").write_text(DESCRIPTION)
    (layouts / "later.yaml").write_text("like: mine\npositions: {clock_offset: 10.1}\n")
    path = folder(tmp_path)
    assert open_recording(f"mine:{path}", layout_folders=(str(layouts),)).stamps[0] == 100_000_000
    later = open_recording(f"later:{path}", layout_folders=[str(layouts)])
    assert later.stamps.tolist() == [0, 100_000_000, 200_000_000, 300_000_000]
    own = tmp_path / "own.yaml"
    own.write_text(DESCRIPTION + f"folder: {path}\n")
    assert open_recording(str(own)).stamps[0] == 100_000_000


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("file: File", "file: Fil", r"frames\.csv: no column 'Fil'; did you mean 'File'"),
        ("column: 1,", "column: 9,", r"track\.csv: no column 9; it has 4"),
        ("csv: track.csv", "csv: trak.csv", r"no file trak\.csv"),
        ("unit: cm", "unit: miles", r"recording\.yaml: positions\.y\.unit: 'miles'"),
        ("heading:", "heding:", "did you mean 'heading'"),
        ("images: pictures", "images: pics", "no frame can be used .*missing_image"),
        ("clock_offset: 10.0", "clock_offset: 99", "no frame can be used .*no_position"),
        ("camera: {", "camera: {sense: left, ", "'sense': 'left'"),
        ("time: {column: Clock", "time: {column: File", "no_time"),
        ("unit: in", "unit: s", r"positions\.x\.unit: 's'"),
        ('"^.*/"', "'['", r"frames\.rename\[0\]: '\[' or its replacement '' is not understood"),
        ('by: ""', "by: '\\9'", "invalid group reference"),
        ('"^.*/"', "'(a+)+$'", "repeats a group; repeat characters"),
        ('"^.*/"', "'(?:a|a)*$'", "repeats a group"),
        ('"^.*/"', "'.*.*.*x'", "too complicated; at most 2 repeats"),
        ('"^.*/"', "'" + "a" * 300 + "'", "'replace' has 1 to 200 characters"),
        ('";"', "'**x'", r"positions\.delimiter: '\*\*x' \(str\), expected ','"),
        ("csv: track.csv", "csv: /etc/passwd", "names no file within the recording's folder"),
        ("csv: track.csv", "csv: ../../x", "names no file within the recording's folder"),
        ("csv: track.csv", "csv: ''", "names no file within the recording's folder"),
        ("csv: track.csv", "csv: '**/**/**/x'", "too complicated; at most"),
        ("csv: track.csv", "csv: '" + "*a" * 30 + "'", "too complicated; at most"),
        ("csv: track.csv", "csv: '[z-a]'", r"no file \[z-a\]"),
        ("clock_offset: 10.0", "clock_offset: 1.0e+300", "out of bounds"),
        ("images: pictures", "images: " + "x" * 300, r"6 missing_image; .*frames\.csv, line 2: no file"),
    ],
)
def test_a_wrong_or_hostile_description_is_one_line_that_names_the_place(
    tmp_path: Path, old: str, new: str, said: str
) -> None:
    assert old in DESCRIPTION
    with refused(said):
        open_recording(str(folder(tmp_path, DESCRIPTION.replace(old, new, 1))))


@pytest.mark.parametrize(
    ("table", "line", "said"),
    [
        ("track.csv", "1;1e999999999;1;1", r"track\.csv, line 2: column '1': '1e999999999' is out of all proportion"),
        ("track.csv", "9e30;1;1;1", r"track\.csv, line 2: column '0': '9e30' is out of all proportion"),
        ("track.csv", "1;" + "9" * 70 + ";1;1", r"track\.csv, line 2: column '1': .* is out of all proportion"),
        ("track.csv", '1;"' + "x" * 200_000 + '";1;1', r"track\.csv, line 2: a row of more than 100,000"),
        ("frames.csv", "x" * 300 + ", 100", r"frames\.csv, line 2: 'xxx.*… has 300 characters, which no"),
    ],
)
def test_a_hostile_row_is_one_line_that_names_it(tmp_path: Path, table: str, line: str, said: str) -> None:
    path = folder(tmp_path)
    lines = (path / table).read_text().splitlines()
    (path / table).write_text("\n".join([lines[0], line, *lines[2:]]))
    with refused(said):
        open_recording(str(path))


def test_a_row_whose_file_is_not_there_or_fits_in_no_folder_is_a_missing_image(tmp_path: Path) -> None:
    path = folder(tmp_path, DESCRIPTION.replace('rename: [{replace: "^.*/", by: "", regex: true}]', ""), skip=(4,))
    table = path / "frames.csv"
    table.write_text(table.read_text().replace("/home/robot/p3", "x" * 300).replace("/home/robot/", ""))
    recording = open_recording(str(path))
    assert recording.dropped == {"no_position": 2, "missing_image": 2}
    assert recording.stamps.tolist() == [100_000_000, 200_000_000]
    assert "frames.csv, line 5: no file" in recording.details["missing_image"]


def test_a_wrong_layout_is_refused_with_the_nearest_name(tmp_path: Path) -> None:
    with refused("did you mean 'antworld'"):
        open_recording(f"antwrld:{tmp_path}")


def test_a_number_read_with_its_column_is_the_one_that_is_read_alone(tmp_path: Path) -> None:
    chance = random.Random(0)
    numbers = ["0", "-0.0", "1e5", "9.99999999e8", "-1.5e+8", "1E-09", "0e9", "123456789.123456789123456789"]
    numbers += [f"{chance.uniform(-9, 9):.18e}" for _ in range(500)] + [repr(chance.gauss(0, 1e5)) for _ in range(500)]
    path = tmp_path / "table.csv"
    path.write_text("plain,alone\n" + "".join(f"{number},{number} m\n" for number in numbers))
    table = read_table(path)
    expected = [float(Decimal(number)) for number in numbers]
    np.testing.assert_array_equal(table.numbers(Length("plain", "m")), expected)
    np.testing.assert_array_equal(table.numbers(Length("alone", "m")), expected)
    for number in ("1e9", "1000000000", "-999999999.9e1", "1e-41"):
        path.write_text(f"a\n{number}1\n")
        with pytest.raises(UnreadableRecording, match=r"line 2: column 'a': '.*' is out of all proportion"):
            read_table(path).numbers(Length("a", "m"))


def test_units_in_cells_go_before_the_columns_unit(tmp_path: Path) -> None:
    path = tmp_path / "table.csv"
    path.write_text('a, b, c\n21.3559 deg, 5 cm, 1700000000.000000001\n0.5, 2", x\n\n')
    table = read_table(path)
    np.testing.assert_allclose(table.numbers(Angle("a", "rad")), [math.radians(21.3559), 0.5])
    np.testing.assert_allclose(table.numbers(Length(1, "m")), [0.05, 0.0508])
    assert table.nanoseconds(Time("c", "s")).tolist() == [1_700_000_000_000_000_001, NO_TIME]
    with pytest.raises(UnreadableRecording, match=r"table\.csv, line 2: column 'b': '5 cm' is not in rad or deg"):
        table.numbers(Angle("b", "rad"))


def test_a_tangent_is_that_of_the_weighted_line_through_four_windows_around_a_moment() -> None:
    rng = np.random.default_rng(4)
    along = np.cumsum(rng.uniform(0.5, 1.5, 40))
    positions = np.column_stack([along, np.sin(along)]) + rng.normal(0, 0.1, (40, 2))
    for lag in (0.0, 2.5):
        directions = track_directions(along, positions, window=1.3, lag=lag)
        for at, direction in zip(np.maximum(along - lag, along[0]), directions, strict=True):
            near = np.abs(along - at) <= 5.2
            weights = np.exp(-(((along[near] - at) / 1.3) ** 2) / 4)  # roots, for they are squared
            (x, y), _ = np.polyfit(along[near] - at, positions[near], 1, w=weights)
            assert direction == pytest.approx(math.atan2(y, x), abs=1e-6)


def test_a_track_that_stands_still_keeps_its_direction() -> None:
    x = np.concatenate([np.arange(10.0), np.full(30, 9.0)])
    directions = track_directions(np.arange(40.0), np.column_stack([x, x]), window=1.0)
    np.testing.assert_allclose(directions, math.pi / 4)


@pytest.mark.parametrize("noise_m", [0.005, 0.1])
def test_noisy_positions_of_a_robot_that_stands_do_not_turn_it(noise_m: float) -> None:
    seconds = np.arange(0.0, 60.0, 0.1)
    x = 0.4 * np.where(seconds < 20.0, seconds, np.maximum(20.0, seconds - 20.0))
    positions = np.column_stack([x, x]) + np.random.default_rng(0).normal(0, noise_m, (len(x), 2))
    assert abs(track_directions(seconds, positions, window=1.0) - math.pi / 4).max() < 0.3


@needs_data
@pytest.mark.parametrize(
    ("log", "frames", "dropped"),
    [
        ("antworld:{}/antworld-rendered/ant1_route1", 406, {}),
        ("antworld:{}/antworld-rendered/ant1_route2", 398, {}),
        ("antworld:{}/antworld-rendered/grid_200mm", 391, {}),
        ("sussex_training:{}/sussex-outdoor-route", 455, {}),
        # the tracker ends at 126.69 s; pictures up to 4 s and after 130.69 s are without position
        ("sussex_repeat:{}/sussex-outdoor-route", 96, {"no_position": 40}),
        ("sussex_repeat:{}/sussex-outdoor-route:infomax_binary", 96, {"no_position": 40}),
    ],
)
def test_the_sample_folders_are_read_by_configuration_alone(log: str, frames: int, dropped: dict[str, int]) -> None:
    recording = open_recording(log.format(DATA))
    assert len(recording.stamps) == frames
    assert recording.dropped == dropped
    assert recording.image(frames // 2) is not None
    assert np.isfinite(recording.truth).all()


@needs_data
def test_antworld_headings_point_along_the_walk() -> None:
    truth = open_recording(f"antworld:{DATA}/antworld-rendered/ant1_route1").truth
    way = truth[4:, :2] - truth[:-4, :2]
    error = wrap(truth[2:-2, 2] - np.arctan2(way[:, 1], way[:, 0]))
    assert np.degrees(np.percentile(np.abs(error), 90)) < 2


@needs_data
def test_sussex_images_turn_with_the_tangent_of_the_track() -> None:
    recording = open_recording(f"sussex_training:{DATA}/sussex-outdoor-route")
    grey = [cv2.cvtColor(recording.image(n), cv2.COLOR_BGR2GRAY) for n in range(0, 455, 3)]
    moved_right = columns_moved(np.array([cv2.resize(each, (600, 25)) for each in grey]))
    turn = wrap(np.diff(recording.truth[::3, 2]))
    assert np.corrcoef(turn, moved_right)[0, 1] < -0.6  # counter-clockwise columns: a turn to the left moves them left


def test_a_folder_of_images_alone_is_taken_in_the_order_of_its_numbers(tmp_path: Path) -> None:
    for number in (10, 9, 1):
        cv2.imwrite(str(tmp_path / f"img{number}.png"), picture(number)[:, :32])
    (tmp_path / "thumbnail.JPG").write_bytes(b"")
    for number in range(4):
        (tmp_path / f"._img{number}.jpg").write_bytes(b"a Mac's notes")
    cv2.imwrite(str(tmp_path / ".img0.png"), picture(0)[:, :32])
    (tmp_path / "notes.txt").write_text("of a walk")
    recording = open_recording(str(tmp_path), rate=4.0)
    assert recording.stamps.tolist() == [0, 250_000_000, 500_000_000]
    np.testing.assert_array_equal(recording.image(0), picture(1)[:, :32])
    assert recording.odometry is recording.truth is None
    assert recording.camera.projection == "equirectangular"
    slow = open_recording(str(tmp_path))
    assert slow.stamps.tolist() == [0, 10**9, 2 * 10**9]
    assert "1 image per second (rate=" in " ".join(slow.assumed)


def as_held(picture: np.ndarray, orientation: int) -> bytes:
    """A JPEG of a picture whose EXIF states an orientation."""
    _, data = cv2.imencode(".jpg", picture)
    entry = b"\x12\x01\x03\x00\x01\x00\x00\x00" + bytes([orientation]) + b"\x00\x00\x00"
    exif = b"Exif\0\0II*\x00\x08\x00\x00\x00\x01\x00" + entry + b"\x00\x00\x00\x00"
    return data.tobytes()[:2] + b"\xff\xe1" + (len(exif) + 2).to_bytes(2, "big") + exif + data.tobytes()[2:]


@pytest.mark.parametrize("orientation", range(1, 9))
def test_an_image_is_turned_as_its_exif_says(orientation: int) -> None:
    data = as_held(picture(0), orientation)
    peer = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR)  # OpenCV's own turning
    np.testing.assert_array_equal(decode_image(data), peer)
    assert orientation_of(data) == orientation


@pytest.mark.parametrize("end", range(0, 60, 3))
def test_an_orientation_that_is_cut_off_is_none(end: int) -> None:
    data = as_held(np.zeros((8, 8, 3), np.uint8), 6)
    assert orientation_of(data[:end]) in (1, 6)
    assert orientation_of(data.replace(b"\x08\x00\x00\x00\x01", b"\xff\xff\xff\xff\x01")) == 1


def test_a_folder_of_images_of_a_turned_camera_is_upright_and_said(tmp_path: Path) -> None:
    picture = cv2.GaussianBlur(np.random.default_rng(1).integers(0, 256, (40, 80, 3), dtype=np.uint8), (0, 0), 5)
    picture = cv2.normalize(picture, None, 0, 255, cv2.NORM_MINMAX)
    for name, pixels, orientation in (("0", picture, 1), ("1", picture[::-1, ::-1], 3), ("2", picture, 1)):
        (tmp_path / f"{name}.jpg").write_bytes(as_held(pixels, orientation))
    source, ctx = LogSource(log=str(tmp_path), camera="equirectangular", rate_hz=1.0, speed_m_s=0.5), Context("source")
    source.setup(ctx)
    first, second = (source.step(ctx, PlaybackState(next=number)).image.pixels for number in (0, 1))
    assert np.abs(first.astype(float) - second).mean() < 3.0
    assert ctx.facts["turned_images"] == "1, as their EXIF orientation says"

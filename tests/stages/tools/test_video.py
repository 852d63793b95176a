import cv2
import numpy as np
import pytest

from omninav.pipeline import BadInput, Context
from omninav.pipeline.mcap.reader import LogReader
from omninav.pipeline.mcap.writer import written_log
from omninav.stages.plots.pose_messages import pose_messages
from omninav.stages.tools.video import BAND, BLUE, GREEN, LIGHT, MAX_HEIGHT, ORANGE, WIDTH, Floor, MakeVideo, scenes_in

SECOND = 10**9


def write_scene(log, seconds, x, y):
    header = {"stamp": {"sec": 100, "nanosec": 0}, "frame_id": "map"}
    pose = pose_messages(np.array([[x, y, 0.0]]))[0]
    log.write(
        "/ground_truth/pose", "geometry_msgs/msg/PoseStamped", round(SECOND * seconds), {"header": header, "pose": pose}
    )


@pytest.fixture
def folder(tmp_path):
    """A run of ten seconds along x; from the sixth on it is lost and believes to be elsewhere."""
    with written_log(tmp_path / "result.mcap") as log:
        for k in range(11):
            now = SECOND * (100 + k)
            header = {"stamp": {"sec": 100 + k, "nanosec": 0}, "frame_id": "map"}
            there, believed = pose_messages(np.array([[0.5 * k, 0.0, 0.0], [0.5 * k, 2.0 * (k >= 6), 0.0]]))
            said = {
                "/ground_truth/pose": ("geometry_msgs/msg/PoseStamped", {"header": header, "pose": there}),
                "/estimate/pose": (
                    "geometry_msgs/msg/PoseWithCovarianceStamped",
                    {"header": header, "pose": {"pose": believed, "covariance": np.zeros(36)}},
                ),
                "/estimate/confidence": ("std_msgs/msg/Float64", {"data": 0.9 if k < 6 else 0.1}),
                "/estimate/state": ("std_msgs/msg/String", {"data": "tracking" if k < 6 else "lost"}),
            }
            if k > 2:  # the first images are missing
                jpeg = cv2.imencode(".jpg", np.full((40, 96, 3), 200, np.uint8))[1]
                image = {"header": header, "format": "jpeg", "data": jpeg.ravel()}
                said["/panorama/compressed"] = ("sensor_msgs/msg/CompressedImage", image)
            for topic, (msgtype, fields) in said.items():
                log.write(topic, msgtype, now, fields)
    return tmp_path


def test_a_video_shows_when_the_robot_is_lost(folder, capsys):
    MakeVideo(run_folder=str(folder), out=str(folder / "video.mp4"), begin=2.0, speed=2.0).run(Context("video"))
    assert "9 images, 4 s, 0.1 MB" in capsys.readouterr().out
    video = cv2.VideoCapture(str(folder / "video.mp4"))
    assert video.get(cv2.CAP_PROP_FPS) == pytest.approx(2.0)
    frames = [video.read()[1] for _ in range(9)]
    assert [bool(frame[:380].mean() > 150) for frame in frames] == [False] + [True] * 8  # a strip of 960 x 400 pixels
    bands = [frame[436, -20] for frame in frames]
    colours = [min((BLUE, ORANGE), key=lambda colour: np.abs(band - np.array(colour, float)).sum()) for band in bands]
    assert colours == [BLUE] * 4 + [ORANGE] * 5


def test_a_cut_log_is_shown_as_far_as_it_reaches_and_said_to_be_cut(folder, capsys):
    log = folder / "result.mcap"
    log.write_bytes(log.read_bytes()[:-20])
    MakeVideo(run_folder=str(folder), out=str(folder / "video.mp4")).run(Context("video"))
    said = capsys.readouterr()
    assert "11 images" in said.out
    assert f"{log}: " in said.err


def test_a_long_way_along_y_fits_into_the_height_and_lies_in_the_middle(tmp_path):
    with written_log(tmp_path / "result.mcap") as log:
        for k in range(51):
            write_scene(log, 100 + k, 7.0, 0.4 * k)
    floor = Floor(list(scenes_in(LogReader(tmp_path / "result.mcap"))))
    assert floor.frame(50).shape == (BAND + MAX_HEIGHT, WIDTH, 3)
    assert floor.pixels(np.array([[7.0, 10.0]])).tolist() == [[WIDTH // 2, MAX_HEIGHT // 2]]
    assert (floor.frame(50)[BAND:, WIDTH // 2 - 2 : WIDTH // 2 + 3] < 100).any(
        axis=(1, 2)
    ).sum() > 800  # the way so far
    assert (floor.frame(5)[BAND:, WIDTH // 2 - 2 : WIDTH // 2 + 3] < 100).any(axis=(1, 2)).sum() < 200


def test_an_occupied_cell_and_the_planned_route_are_drawn_where_they_lie(tmp_path):
    with written_log(tmp_path / "result.mcap") as log:
        write_scene(log, 100, 1.0, 1.0)
        data = np.zeros((30, 50), np.int8)
        data[2, 40], data[20, 10] = 51, 50
        place = {"position": {"x": -1.0, "y": 0.0}}
        info = {"resolution": 0.1, "width": 50, "height": 30, "origin": place}
        log.write("/grid", "nav_msgs/msg/OccupancyGrid", SECOND * 100, {"info": info, "data": data.ravel()})
        poses = [
            {"pose": pose} for pose in pose_messages(np.array([[0.0, 2.5, 0.0], [1.0, 2.5, 0.0], [3.0, 2.5, 0.0]]))
        ]
        log.write("/plan", "nav_msgs/msg/Path", SECOND * 100, {"poses": poses})
    floor = Floor(list(scenes_in(LogReader(tmp_path / "result.mcap"))))
    rows, columns = np.nonzero((floor.plan == LIGHT).all(axis=2))
    expected = floor.pixels(np.array([[3.0, 0.3], [3.1, 0.2]]))
    drawn = np.array([[columns.min(), rows.min()], [columns.max(), rows.max()]])
    assert np.abs(drawn - expected).max() <= 1
    rows, columns = np.nonzero((floor.frame(0)[BAND:] == GREEN).all(axis=2))
    (left, row), (right, _) = floor.pixels(np.array([[0.0, 2.5], [3.0, 2.5]]))
    assert np.abs([columns.min() - left, columns.max() - right, rows.min() - row, rows.max() - row]).max() <= 2


def test_no_way_is_drawn_to_where_the_robot_was_carried(tmp_path):
    with written_log(tmp_path / "result.mcap") as log:
        for k, x in enumerate((0.0, 0.5, 8.0, 8.5)):
            write_scene(log, 100 + k, x, 0.0)
    floor = Floor(list(scenes_in(LogReader(tmp_path / "result.mcap"))))
    places = floor.pixels(np.array([[0.25, 0.0], [4.0, 0.0], [8.1, 0.0]]))
    assert [bool((floor.frame(3)[BAND + y, x] < 100).all()) for x, y in places] == [True, False, True]


@pytest.mark.parametrize(("seconds", "rate"), [(0.0, 1.0), (0.001, 120.0), (100.0, 1.0)])
def test_a_video_has_a_rate_that_players_can_show(tmp_path, seconds, rate):
    with written_log(tmp_path / "result.mcap") as log:
        for k in range(3):
            write_scene(log, 100 + seconds * k, 0.1 * k, 0.0)
    MakeVideo(run_folder=str(tmp_path), out=str(tmp_path / "video.mp4"), speed=1.0).run(Context("video"))
    assert cv2.VideoCapture(str(tmp_path / "video.mp4")).get(cv2.CAP_PROP_FPS) == pytest.approx(rate)


def test_a_pause_between_two_logs_makes_a_video_no_slower(tmp_path):
    with written_log(tmp_path / "result.mcap") as log:
        for k in range(10):
            write_scene(log, 100 + 0.5 * k + 86400 * (k >= 5), 0.1 * k, 0.0)
    MakeVideo(run_folder=str(tmp_path), out=str(tmp_path / "video.mp4"), speed=3.0).run(Context("video"))
    assert cv2.VideoCapture(str(tmp_path / "video.mp4")).get(cv2.CAP_PROP_FPS) == pytest.approx(6.0)


def whole_video(file, width):
    writer = cv2.VideoWriter(str(file), cv2.VideoWriter.fourcc(*"mp4v"), 4.0, (width, 400))
    writer.write(np.zeros((400, width, 3), np.uint8))
    writer.release()
    return file.read_bytes()


def test_a_recording_is_not_written_over(folder):
    before = whole_video(folder / "drive.mp4", 640)
    with pytest.raises(BadInput, match=r"drive\.mp4 is there, and no such video; type another name"):
        MakeVideo(run_folder=str(folder), out=str(folder / "drive.mp4")).run(Context("video"))
    assert (folder / "drive.mp4").read_bytes() == before


def test_a_video_that_fails_leaves_the_one_that_was_there(folder, monkeypatch):
    def fails(floor, number):
        raise RuntimeError("half way")

    before = whole_video(folder / "video.mp4", 960)
    monkeypatch.setattr(Floor, "frame", fails)
    with pytest.raises(RuntimeError):
        MakeVideo(run_folder=str(folder), out=str(folder / "video.mp4")).run(Context("video"))
    assert {path.name: path.read_bytes() for path in folder.glob("*video*")} == {"video.mp4": before}
    assert [path.name for path in folder.glob(".video*")] == []


def test_a_scene_holds_the_last_of_each_topic(folder):
    scenes = list(scenes_in(LogReader(folder / "result.mcap")))
    assert [scene["seconds"] for scene in scenes] == list(range(11))
    assert [scene["/estimate/state"].data for scene in scenes[5:7]] == ["tracking", "lost"]


@pytest.mark.parametrize(
    ("settings", "said"),
    [
        ({"out": "video.gif"}, "type out=video.mp4"),
        ({"run_folder": "nowhere"}, "no result.mcap"),
        ({"begin": 8.0, "end": 2.0}, r"begin=8 is not before end=2; both are seconds"),
        ({"begin": 20.0}, "no poses between 20 s"),
        ({"out": "nowhere/video.mp4"}, "is its folder there"),
    ],
)
def test_what_cannot_be_shown_is_refused_in_one_line(folder, settings, said):
    with pytest.raises(BadInput, match=said):
        MakeVideo(**{"run_folder": str(folder), "out": str(folder / "video.mp4"), **settings}).run(Context("video"))

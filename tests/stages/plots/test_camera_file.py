from dataclasses import replace

from landmark_tour import mapped_room

from omninav.pipeline import Context
from omninav.stages.plots.camera_file import CameraFile


def test_the_camera_that_a_map_asks_for_is_written_and_nothing_where_it_asks_for_none(tmp_path):
    map = mapped_room()
    asking = replace(map, landmarks=replace(map.landmarks, camera="projection: donut\n"))
    for each in (map, replace(map, landmarks=None)):
        CameraFile().step(Context("camera_file", folder=tmp_path), each)
        assert not list(tmp_path.iterdir())
    CameraFile().step(Context("camera_file", folder=tmp_path), asking)
    assert (tmp_path / "camera.yaml").read_text() == "projection: donut\n"

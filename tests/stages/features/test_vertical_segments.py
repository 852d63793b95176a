"""Upright lines between edges: where they are found, what describes them, which one stands for its neighbours."""

import math

import cv2
import numpy as np
import pytest
from scipy import fft
from turned_robot import CAMERA, both_kinds, look, wrapped

from omninav.pipeline import Context
from omninav.stages.camera.dual_fisheye import DualFisheye
from omninav.stages.camera.fisheye import Fisheye
from omninav.stages.camera.model import Camera
from omninav.stages.camera.ocamcalib import OCamCalib
from omninav.stages.camera.rays import angles
from omninav.stages.features.global_colours import GlobalColours
from omninav.stages.features.vertical_segments import FindVerticalSegments, ImageSegments, prototypes, segments_of
from omninav.stages.geometry.appearance.feature_matching import mahalanobis_matches
from omninav.stages.values.image import Image, Panorama
from omninav.stages.values.local_features import VerticalSegments


def found(picture: Image | Panorama, camera: Camera = CAMERA, **parameters: object) -> VerticalSegments:
    stage, context = FindVerticalSegments(**parameters), Context("columns")
    stage.setup(context)
    columns = stage.step(context, image=picture, camera=camera).vertical_segments
    assert isinstance(columns, VerticalSegments)
    return columns


def banded(edges: list[int], greys: list[int], rows: int = 80, columns: int = 60) -> np.ndarray:
    """A picture of bands, the same in all columns, with some colour."""
    pixels = np.zeros((rows, columns, 3), np.uint8)
    for first, last, grey in zip([0, *edges], [*edges, rows], greys, strict=True):
        pixels[first:last] = (grey, grey // 2 + 30, 255 - grey)
    return pixels


def test_segments_lie_between_neighbouring_edges() -> None:
    segments = segments_of(banded([20, 41, 60], [30, 120, 60, 200]), True, 1.0, 0.05, 5.0, 0.2)
    one = segments.lines == 7
    assert np.unique(segments.lines).tolist() == list(range(60))
    assert segments.ends[one].tolist() == [[19.5, 40.5], [40.5, 59.5]]
    ramps = np.full((60, 40, 3), 100, np.uint8)
    ramps[20:41], ramps[21:40] = 120, 160
    # Gradients of 10, 30 and 20 in rows 19, 20 and 21: their parabola is highest a sixth of a row further.
    assert segments_of(ramps, True, 0.1, 0.05, 5.0, 0.2).ends[0] == pytest.approx([20 + 1 / 6, 40 - 1 / 6])


def test_a_profile_is_described_by_seven_coefficients_of_scipys_transform_of_its_eight_samples() -> None:
    pixels = np.full((60, 40, 3), 240, np.uint8)
    pixels[20:40] = (100 + 2 * np.arange(20))[:, None, None]
    segments = segments_of(pixels, True, 0.1, 0.1, 8.0, 0.0)
    top, bottom = segments.ends[0]
    profile = 100 + 2 * (top + (np.arange(8) + 0.5) * (bottom - top) / 8 - 20)
    assert segments.descriptors[0, 3:] == pytest.approx(fft.dct(profile, norm="ortho")[:7], abs=1e-3)


def test_colours_are_those_of_a_segment_widened_at_both_ends() -> None:
    pixels = np.full((60, 40, 3), 100, np.int64)
    pixels[:20] = pixels[40:] = 240
    pixels = (pixels + np.random.default_rng(0).integers(-2, 3, (60, 1, 3))).astype(np.uint8)
    found = segments_of(pixels, True, 0.3, 0.5, 8.0, 0.2)
    assert found.ends[0] == pytest.approx([19.5, 39.5], abs=0.2)
    widened = cv2.GaussianBlur(pixels, (0, 0), 0.3)[16:44, 0]  # 4 of 20 rows beyond each end
    of = np.corrcoef(widened.T.astype(float))
    assert found.descriptors[0, :3] == pytest.approx([of[2, 1], of[2, 0], of[1, 0]], abs=1e-5)


def test_colours_do_not_change_with_the_light_and_the_profile_does_as_the_light() -> None:
    panorama = look("panorama", 0.0).pixels
    lit = (panorama * 0.5 + 40.0).round().astype(np.uint8)
    one, other = (segments_of(pixels, True, 1.0, 0.1, 8.0, 0.2) for pixels in (panorama, lit))
    assert abs(len(one.lines) - len(other.lines)) < 0.05 * len(one.lines)
    keys = [[tuple(row) for row in np.column_stack([s.lines, s.ends.round()]).tolist()] for s in (one, other)]
    places = {key: row for row, key in enumerate(keys[0])}
    both = np.array([(places[key], row) for row, key in enumerate(keys[1]) if key in places])
    before, after = one.descriptors[both[:, 0]], other.descriptors[both[:, 1]]
    assert len(both) > 0.7 * len(one.lines)
    assert np.median(np.abs(before[:, :3] - after[:, :3])) < 0.03
    lighter = 0.5 * before[:, 3:] + 40.0 * math.sqrt(8.0) * (np.arange(7) == 0)
    assert np.median(np.abs(lighter - after[:, 3:])) < 1.0


@both_kinds
@pytest.mark.parametrize("turn", [0.7, 2.9])
def test_a_robot_that_turns_sees_the_same_segments_turned_the_other_way(kind: str, turn: float) -> None:
    one, other = found(look(kind, 0.0)), found(look(kind, turn))
    pairs = mahalanobis_matches(one.descriptors, other.descriptors, 0.8)
    off = np.abs(wrapped(other.azimuths[pairs.second] - one.azimuths[pairs.first] + turn))
    assert len(off) > 60
    assert (off < math.radians(4.0)).mean() > 0.85
    right = off < math.radians(4.0)
    higher = one.elevations[pairs.first][right] - other.elevations[pairs.second][right]
    assert np.median(np.abs(higher)) < math.radians(1.0)


@both_kinds
def test_both_ends_are_given_as_bearings_the_upper_first(kind: str) -> None:
    columns = found(look(kind, 0.3))
    bearings = columns.bearings()
    assert np.linalg.norm(bearings, axis=-1) == pytest.approx(np.ones((len(columns), 2)))
    assert (columns.elevations[:, 0] > columns.elevations[:, 1]).all()
    assert np.arctan2(bearings[:, 0, 1], bearings[:, 0, 0]) == pytest.approx(columns.azimuths)
    assert (np.diff(columns.weights) <= 0.0).all()


@pytest.mark.parametrize(
    "camera",
    [
        DualFisheye(640, 320, 96.0, 158.0, 161.0, 482.0, 159.0, 156.0, 0.4, -2.0, yaw=0.7),
        Fisheye(320, 320, 100.0, 159.5, 159.5, 155.0, 20.0),
        OCamCalib(640, 480, (-140.0, 0.0, 4.0e-3), 239.5, 319.5, 236.0, 34.0, looks="down", yaw=0.3),
    ],
    ids=lambda camera: camera.projection,
)
def test_segments_are_upright_and_their_upper_end_is_above_the_lower_one(camera: Camera) -> None:
    noise = np.random.default_rng(0).integers(0, 255, (camera.height_px, camera.width, 3)).astype(np.uint8)
    columns = found(Image(cv2.GaussianBlur(noise, (0, 0), 3.0)), camera)
    assert len(columns) == 200
    azimuths, elevations = angles(camera.unproject(columns.points)[0])
    assert np.abs(wrapped(azimuths - columns.azimuths[:, None])).max() < 1e-6
    assert elevations == pytest.approx(columns.elevations)
    assert (elevations[:, 0] > elevations[:, 1]).all()


def test_neighbours_that_look_alike_become_the_one_in_their_middle() -> None:
    rng = np.random.default_rng(3)
    looks = rng.normal(size=(2, 10)).astype(np.float32)
    lines = np.array([0, 1, 2, 3, 4, 58, 59, 20, 21, 20], np.int64)  # seven across the seam, two apart, one unlike
    order = np.argsort(lines, kind="stable")
    ends = np.tile([10.0, 30.0], (10, 1))
    look_of = np.array([0, 0, 0, 0, 0, 0, 0, 0, 0, 1])
    segments = ImageSegments(lines[order], ends, looks[look_of[order]])
    kept, weights = prototypes(segments, 60, 1.6, 2.0, True)
    assert weights.tolist() == [7.0, 2.0, 1.0]
    assert segments.lines[kept[0]] == 1
    apart = ImageSegments(lines[order], ends + 40.0 * (np.arange(10) % 2)[:, None], looks[look_of[order]])
    assert len(prototypes(apart, 60, 1.6, 2.0, True)[0]) > 3  # one above the other are not the same


@pytest.mark.parametrize(
    ("columns", "lines", "represented"),
    [
        (60, [0, 4, 20], [2, 1]),  # a neighbour is at most two times two columns away
        (60, [0, 5, 20], [1, 1, 1]),
        (60, [0, 57, 20], [2, 1]),
        (9, [0, 8, 4], [2, 1]),
        (8, [0, 7, 4], [1, 1, 1]),  # where all are neighbours there is no seam
    ],
)
def test_neighbours_are_so_many_columns_away_at_most(columns: int, lines: list[int], represented: list[int]) -> None:
    looks = np.random.default_rng(3).normal(size=(2, 10)).astype(np.float32)[[0, 0, 1]]
    order = np.argsort(lines)
    segments = ImageSegments(np.array(lines)[order], np.tile([10.0, 30.0], (3, 1)), looks[order])
    assert prototypes(segments, columns, 2.0, 2.0, True)[1].tolist() == represented


def test_a_picture_of_nothing_has_no_segments() -> None:
    assert len(found(Panorama(np.full((80, 360, 3), 90, np.uint8)))) == 0


@both_kinds
def test_colours_of_a_whole_view_stay_when_the_robot_turns(kind: str) -> None:
    stage = GlobalColours()
    one, other = (
        stage.step(Context("moments"), image=look(kind, heading), camera=CAMERA).descriptor.values
        for heading in (0.0, 2.0)
    )
    assert np.abs(one - other).max() < 0.01

"""A robot sees its own body at the same place of all images, and nothing of the world there once it has turned."""

import math

import numpy as np
import pytest

from omninav.pipeline import Context, Tick
from omninav.stages.camera.equirectangular import Equirectangular
from omninav.stages.features.rotation_reduced_sift import RotationReducedSift
from omninav.stages.features.without_body import OwnBodyState, WithoutBody
from omninav.stages.values.image import Image
from omninav.stages.values.local_features import LocalFeatures, VerticalSegments
from omninav.stages.values.maps import ReferenceEvent
from omninav.stages.values.own_body import OwnBody, references_without_body
from omninav.stages.values.pose import Motion

CAMERA = Equirectangular(640, 320, column_of_forward=320.0)
NUMBER = 120
"""Features of the world, and of the body."""
REFERENCE = ReferenceEvent(0, "far")


def features(points: np.ndarray, descriptors: np.ndarray) -> LocalFeatures:
    number = len(points)
    return LocalFeatures(
        CAMERA.unproject(points)[0], points, descriptors, np.zeros((number, 3), np.float32), np.ones(number, np.float32)
    )


class Drive:
    """Images of points far away, and of a body in columns 200 to 260 and rows 160 to 280."""

    def __init__(self, body: bool = True) -> None:
        self.rng = np.random.default_rng(0)
        self.azimuths = self.rng.uniform(-math.pi, math.pi, NUMBER)
        self.rows = self.rng.uniform(100.0, 220.0, NUMBER)
        self.looks = self.rng.integers(0, 256, (2 * NUMBER, 128), dtype=np.uint8)
        self.body = self.rng.uniform((200.0, 160.0), (260.0, 280.0), (NUMBER if body else 0, 2))
        self.stage, self.state = WithoutBody(), OwnBodyState()

    def image(self, heading: float) -> LocalFeatures:
        flat = np.column_stack([np.cos(self.azimuths - heading), np.sin(self.azimuths - heading), np.zeros(NUMBER)])
        columns = CAMERA.project(flat)[0][:, 0]
        world = np.column_stack([columns, self.rows])
        points = np.concatenate([world, self.body]) + self.rng.normal(0.0, 0.3, (NUMBER + len(self.body), 2))
        return features(np.clip(points, 0.0, (639.0, 319.0)), self.looks[: len(points)])

    def out(self, heading: float) -> tuple[LocalFeatures, OwnBody]:
        out = self.stage.step(Context("body"), self.image(heading), CAMERA, self.state)
        return out.features, out.body


@pytest.mark.parametrize("step_deg", [4.0, -25.0])
def test_the_body_is_left_out_once_the_robot_has_turned(step_deg: float) -> None:
    drive = Drive()
    assert len(drive.out(0.0)[0]) == 2 * NUMBER
    for number in range(1, 30):
        seen, body = drive.out(math.radians(step_deg) * number)
    x, y = seen.points.T
    own = (x > 200.0) & (x < 260.0) & (y > 160.0) & (y < 280.0)
    assert np.count_nonzero(~own) > 0.9 * NUMBER * (1.0 - 60.0 / 640.0)
    assert np.count_nonzero(own) < 0.03 * NUMBER
    assert body.hides(np.array([230.0, 220.0]))
    assert not body.hides(np.array([[400.0, 220.0], [230.0, 110.0]])).any()


@pytest.mark.parametrize("turning", [False, True])
def test_without_a_body_or_a_turn_nothing_is_left_out(turning: bool) -> None:
    drive = Drive(body=not turning)
    for number in range(30):
        seen, body = drive.out(math.radians(12.0) * number * turning)
        assert not body.cells.any()
        assert len(seen) == NUMBER * (1 if turning else 2)


def test_another_camera_begins_anew() -> None:
    drive = Drive()
    for number in range(30):
        drive.out(math.radians(12.0) * number)
    assert drive.state.body.cells.any()
    out = drive.stage.step(
        Context("body"), drive.image(0.0), Equirectangular(720, 360, column_of_forward=360.0), drive.state
    )
    assert not out.body.cells.any()


def test_things_near_that_pass_by_on_one_side_are_no_turn() -> None:
    stage, state, rng = WithoutBody(), OwnBodyState(), np.random.default_rng(2)
    looks = rng.integers(0, 256, (4 * NUMBER, 128), dtype=np.uint8)
    wall = np.column_stack([rng.uniform(-10.0, 40.0, 3 * NUMBER), np.full(3 * NUMBER, 2.0)])
    far = np.deg2rad(rng.uniform(-170.0, -10.0, NUMBER))
    rows = rng.uniform(100.0, 220.0, 4 * NUMBER)
    for number in range(60):
        near = wall - (0.3 * number, 0.0)
        azimuths = np.concatenate([np.arctan2(near[:, 1], near[:, 0]), far])
        flat = np.column_stack([np.cos(azimuths), np.sin(azimuths), np.zeros(4 * NUMBER)])
        points = np.column_stack([np.clip(CAMERA.project(flat)[0][:, 0], 0.0, 639.0), rows])
        assert not stage.step(Context("body"), features(points, looks), CAMERA, state).body.cells.any()


@pytest.mark.parametrize("turn", [0.0, 0.02, 0.21, -0.21])
def test_the_turn_must_have_been_measured_where_there_is_odometry(turn: float) -> None:
    drive = Drive()
    for number in range(30):
        image = drive.image(0.21 * number)
        body = drive.stage.step(Context("body"), image, CAMERA, drive.state, Motion(0.0, 0.0, turn)).body
    assert body.cells.any() == (abs(turn) > 0.015)


def test_each_log_has_a_body_of_its_own() -> None:
    drive, context = Drive(), Context("body")
    for number in range(30):
        drive.out(math.radians(12.0) * number)
    first = drive.state.body
    context.tick = Tick(30, 0, 1, 0, True)
    second = drive.stage.step(context, drive.image(0.0), CAMERA, drive.state).body
    assert first.cells.any()
    assert (second.cells.any(), first.log, second.log) == (False, 0, 1)
    seen = drive.image(0.0)
    kept = references_without_body([seen, seen], [REFERENCE] * 2, [OwnBody(), second])
    assert [len(each or ()) for each in kept] == [2 * NUMBER, 2 * NUMBER]
    kept = references_without_body([seen, seen, seen], [REFERENCE] * 3, [OwnBody(), first, second])
    assert len(kept[0] or ()) < 1.1 * NUMBER
    assert len(kept[2] or ()) == 2 * NUMBER


def test_a_body_that_is_put_on_late_is_found() -> None:
    drive = Drive()
    own, drive.body = drive.body, drive.body[:0]
    for number in range(100):
        drive.out(math.radians(12.0) * number)
    drive.body = own
    for number in range(100, 130):
        seen, _ = drive.out(math.radians(12.0) * number)
    assert len(seen) < 1.1 * NUMBER


def test_all_of_a_tour_is_without_the_body_that_its_end_knows() -> None:
    cells = np.zeros((40, 80), np.bool_)
    cells[20:, :40] = True
    body = OwnBody(cells, 8.0, (640, 320))
    points = np.array([[100.0, 200.0], [100.0, 100.0], [400.0, 200.0]])
    segments = VerticalSegments(
        np.zeros(3), np.zeros((3, 2)), np.zeros((3, 10), np.float32), np.ones(3, np.float32),
        np.array([[[100.0, 90.0], [100.0, 200.0]], [[500.0, 90.0], [500.0, 200.0]], [[100.0, 9.0], [100.0, 90.0]]]),
    )  # fmt: skip
    seen = features(points, np.zeros((3, 128), np.uint8))
    seen = LocalFeatures(seen.bearings, points, seen.descriptors, seen.colours, seen.sizes, segments)
    kept = references_without_body([seen, seen, None], [REFERENCE, None, REFERENCE], [OwnBody(), body, None])
    assert kept[1] is None
    assert kept[0] is not None
    assert len(kept) == 2
    np.testing.assert_array_equal(kept[0].points, points[1:])
    assert kept[0].columns is not None
    np.testing.assert_array_equal(kept[0].columns.points, segments.points[1:])
    assert references_without_body([seen], [REFERENCE], []) == [seen]


@pytest.mark.parametrize("orientation", ["reduced", "own"])
def test_a_body_takes_no_features_from_the_world(orientation: str) -> None:
    rng = np.random.default_rng(1)
    pixels = np.full((320, 640, 3), 128, np.uint8)
    pixels[::8, 320::8] = rng.integers(0, 256, (40, 40, 3))
    pixels[:, :320] = np.kron(rng.integers(0, 256, (80, 80, 1)), np.ones((4, 4, 3))).astype(np.uint8)
    cells = np.zeros((40, 80), np.bool_)
    cells[:, :41] = True
    stage = RotationReducedSift(orientation=orientation, max_features=60, contrast=0.001)
    stage.setup(Context("features"))
    alone = stage.step(Context("features"), Image(pixels), CAMERA).features
    assert (alone.points[:, 0] < 328.0).mean() > 0.8
    beside = stage.step(Context("features"), Image(pixels), CAMERA, OwnBody(cells, 8.0, (640, 320))).features
    assert len(beside) == 60
    assert (beside.points[:, 0] >= 327.0).all()

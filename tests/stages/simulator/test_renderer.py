"""What the ray caster draws, against geometry worked out without it."""

import dataclasses
import math

import cv2
import numba
import numpy as np
import numpy.typing as npt
import pytest
from world_files import DEMO

from omninav.pipeline import BadInput
from omninav.stages.camera.cylindrical import Cylindrical
from omninav.stages.camera.donut import Donut
from omninav.stages.camera.double_sphere import DoubleSphere
from omninav.stages.camera.equirectangular import Equirectangular
from omninav.stages.camera.hyperbolic import HyperbolicMirror
from omninav.stages.camera.model import Camera
from omninav.stages.camera.perspective import Perspective
from omninav.stages.camera.rays import turned
from omninav.stages.simulator.cameras import camera_of, camera_rays, shutter_times
from omninav.stages.simulator.config import Block, Lamp, Sensor, WorldConfig, mirror
from omninav.stages.simulator.people import Person
from omninav.stages.simulator.renderer import Scene, render
from omninav.stages.simulator.world import World

EYE = 0.9
PANORAMA = Equirectangular(
    width=720,
    height_px=180,
    column_of_forward=360.0,
    elevation_top=math.radians(40),
    elevation_bottom=-math.radians(50),
)


@pytest.fixture(scope="module")
def demo() -> Scene:
    return World(DEMO).scene


@pytest.fixture(scope="module")
def marker() -> tuple[Scene, npt.NDArray[np.float64]]:
    """An otherwise bare, evenly lit room with one shining box, and the box's corners on the map (8, 3)."""
    config = WorldConfig(
        shelves=(),
        wall_panels=(),
        lamps=(Lamp((3.0, 2.0)),),
        blocks=(Block(centre=(6.0, 5.0), size=(0.8, 0.5), height=0.7, bottom_z=0.4, yaw=0.4),),
    )
    world = World(config)
    scene = world.scene
    number = next(k for k, box in enumerate(world.boxes) if box.kind == "block")
    texels, glow = np.zeros_like(scene.texels), np.zeros_like(scene.glow)
    block = scene.tiles[scene.surface_table[scene.faces[number], 0]]
    start, side = 0, scene.side
    while side >= 1:
        level = texels[start : start + len(glow) * side * side].reshape(len(glow), -1)
        level[block] = 0xFFFFFF
        start, side = start + level.size, side // 2
    glow[block] = 1.0
    cos, sin = math.cos(0.4), math.sin(0.4)
    corners = [
        (6.0 + cos * along - sin * across, 5.0 + sin * along + cos * across, z)
        for along in (-0.4, 0.4)
        for across in (-0.25, 0.25)
        for z in (0.4, 1.1)
    ]
    return scene._replace(texels=texels, glow=glow), np.array(corners)


def seen_from(points: npt.NDArray[np.float64], pose: tuple[float, float, float]) -> npt.NDArray[np.float64]:
    """Points of the map in the robot's frame, from the eye."""
    return turned(points - np.array([pose[0], pose[1], EYE]), -pose[2])


FACES = ((0, 1, 3, 2), (4, 5, 7, 6), (0, 1, 5, 4), (2, 3, 7, 6), (0, 2, 6, 4), (1, 3, 7, 5))
"""Corners around each face, numbered 4 x + 2 y + z."""


CYLINDER = Cylindrical(720, 180, 360.0, elevation_top=0.6, elevation_bottom=-0.8)
CAMERAS = [
    camera_of(WorldConfig(camera=mirror(320))),
    CYLINDER,
    Equirectangular(720, 180, 360.0, elevation_top=0.7, elevation_bottom=-0.85),
    Perspective(320, 240, 277.0, 277.0, 159.5, 119.5),
    DoubleSphere(320, 240, 55.0, 55.0, 159.5, 119.5, -0.2, 0.59, outer_radius_px=119.0, yaw=0.3),
]


@pytest.mark.parametrize("pose", [(4.6, 4.2, 0.3), (7.2, 6.4, -2.0), (6.3, 3.2, 1.9)])
@pytest.mark.parametrize("camera", CAMERAS, ids=lambda camera: camera.projection)
def test_each_camera_sees_a_box_within_half_a_pixel_of_where_its_edges_project(
    marker: tuple[Scene, npt.NDArray[np.float64]], camera: Camera, pose: tuple[float, float, float]
) -> None:
    """Its faces, with edges finely cut and projected, are filled at 8 times the size: there the outline is known."""
    scene, corners = marker
    if camera.elevations is None:  # it does not see all around, so it is turned to the box
        camera = dataclasses.replace(camera, yaw=math.atan2(5.0 - pose[1], 6.0 - pose[0]) - pose[2] + 0.1)
    picture = render(scene, camera_rays(camera), pose, EYE)[..., 0]
    fine = np.zeros((camera.height_px * 8, camera.width * 8), dtype=np.uint8)
    for face in FACES:
        edges = [
            corners[a] + (corners[b] - corners[a]) * part
            for a, b in zip(face, (*face[1:], face[0]), strict=True)
            for part in np.linspace(0.0, 1.0, 100)
        ]
        pixels = camera.project(seen_from(np.array(edges), pose))[0]
        cv2.fillPoly(fine, [np.round(pixels * 8).astype(np.int32)], 255)
    lit = picture > 127
    assert lit.sum() > 100
    inside = cv2.distanceTransform(fine, cv2.DIST_L2, cv2.DIST_MASK_PRECISE)[::8, ::8] / 8
    outside = cv2.distanceTransform(255 - fine, cv2.DIST_L2, cv2.DIST_MASK_PRECISE)[::8, ::8] / 8
    assert lit[(inside > 0.5) & camera.mask()].all()
    assert not lit[outside > 0.5].any()


def test_the_panorama_has_no_seam(demo: Scene) -> None:
    """First and last columns differ as neighbours inside do: with the seam put elsewhere the same pixels come out."""
    rays = camera_rays(PANORAMA)
    elsewhere = camera_rays(dataclasses.replace(PANORAMA, column_of_forward=180.0))
    whole = render(demo, rays, (5.8, 4.5, 0.4), EYE)
    moved = render(demo, elsewhere, (5.8, 4.5, 0.4), EYE)
    assert np.mean(np.abs(np.roll(whole, -180, axis=1).astype(int) - moved).max(axis=-1) > 2) < 0.002


def test_the_sense_of_a_strip_mirrors_it(demo: Scene) -> None:
    strip = Cylindrical(width=360, height_px=80, column_of_forward=180.0, elevation_top=0.5, elevation_bottom=-0.6)
    clockwise = render(demo, camera_rays(strip), (5.8, 4.5, 0.4), EYE)
    counter = dataclasses.replace(strip, sense="counter_clockwise")
    np.testing.assert_array_equal(clockwise[:, ::-1], render(demo, camera_rays(counter), (5.8, 4.5, 0.4), EYE))


def test_a_low_shelf_is_looked_over(demo: Scene) -> None:
    """From high above the shelves, the far wall is seen over them; from the floor it is not."""
    rays = camera_rays(PANORAMA)
    low, high = render(demo, rays, (5.8, 1.3, 1.57), 0.4), render(demo, rays, (5.8, 1.3, 1.57), 2.9)
    above_horizon = slice(60, 78)  # a few degrees above to just above the horizon
    assert np.abs(low[above_horizon].astype(int) - high[above_horizon]).mean() > 10


def test_noise_follows_from_its_key_alone_and_has_the_stated_spread(demo: Scene) -> None:
    rays = camera_rays(camera_of(DEMO), 0.1)
    pose = (5.8, 4.5, 0.4)
    clean = render(demo, rays, pose, EYE).astype(float)
    noisy = [render(demo, rays, pose, EYE, noise=3.0, key=key) for key in (7, 7, 8)]
    np.testing.assert_array_equal(noisy[0], noisy[1])
    middle = (clean > 20) & (clean < 235)
    for picture in (noisy[0], noisy[2]):
        error = (picture - clean)[middle]
        assert abs(error.mean()) < 0.05
        assert abs(error.std() - math.sqrt(3.0**2 + 1 / 6)) < 0.05  # two roundings of variance 1/12
    first, second = (noisy[0] - clean)[middle], (noisy[2] - clean)[middle]
    assert abs(np.corrcoef(first, second)[0, 1]) < 0.02  # the clean picture's rounding is in both: 1/12 of 9


def test_the_ring_is_lit_and_the_robot_in_its_middle_is_black(demo: Scene) -> None:
    camera = camera_of(DEMO)
    assert isinstance(camera, HyperbolicMirror)
    picture = render(demo, camera_rays(camera), (5.8, 4.5, 0.4), EYE)
    v, u = np.mgrid[0:480, 0:640]
    radius = np.hypot(u - camera.centre_x, v - camera.centre_y)
    assert picture[(radius < 34) | (radius > 238)].max() == 0
    assert np.mean(picture[(radius > 35) & (radius < 237)].max(axis=-1) > 10) > 0.99


def test_the_number_of_threads_does_not_change_a_picture(demo: Scene) -> None:
    rays = camera_rays(camera_of(DEMO), 0.1)
    threads = numba.get_num_threads()
    try:
        pictures = []
        for number in (1, threads):
            numba.set_num_threads(number)
            people = (Person((7.0, 4.6), 0.3), Person((4.6, 4.4), 2.0, look=5, stride=1.0))
            pictures.append(render(demo, rays, (5.8, 4.5, 0.4), EYE, noise=2.0, key=3, people=people))
    finally:
        numba.set_num_threads(threads)
    np.testing.assert_array_equal(*pictures)


def test_a_turn_by_whole_columns_is_a_shift_to_within_a_tenth_of_a_column(demo: Scene) -> None:
    """Measured by phase correlation, rows together, to a fraction of a column, for turns either way."""
    rays = camera_rays(CYLINDER)
    before = render(demo, rays, (5.8, 4.5, 0.4), EYE).astype(float).mean(axis=2)
    for columns in (1, 37, 360, -200):
        turned = render(demo, rays, (5.8, 4.5, 0.4 + columns * 2 * math.pi / 720), EYE).astype(float).mean(axis=2)
        spectrum = (np.fft.rfft(turned, axis=1) * np.conj(np.fft.rfft(before, axis=1))).sum(axis=0)
        spectrum[0] = 0.0
        fine = np.fft.irfft(spectrum, n=720 * 50)  # padded: fifty steps to a column
        shift = int(fine.argmax()) / 50
        assert abs(math.remainder(shift - columns, 720)) <= 0.1


def test_the_robot_sees_its_deck_and_its_camera_in_the_middle_of_the_mirror(demo: Scene) -> None:
    camera = camera_of(DEMO)
    assert isinstance(camera, HyperbolicMirror)
    alone = render(demo, camera_rays(camera), (5.8, 4.5, 0.4), EYE)
    whole = render(demo, camera_rays(camera, robot_radius=0.25), (5.8, 4.5, 0.4), EYE)
    v, u = np.mgrid[0:480, 0:640]
    radius = np.hypot(u - camera.centre_x, v - camera.centre_y)
    np.testing.assert_array_equal(whole[radius >= 34], alone[radius >= 34])
    assert (whole[radius < 33].max(axis=-1) > 8).all()
    # The red mark on the deck lies ahead: bearing 0 is at the picture angle -yaw.
    red = (whole[..., 2].astype(int) - whole[..., 0] > 40) & (radius < 34)
    bearing = math.atan2(v[red].mean() - camera.centre_y, u[red].mean() - camera.centre_x) + camera.yaw
    assert abs(bearing) < 0.05


def test_motion_blur_is_the_mean_over_the_poses_of_the_shutter_time(demo: Scene) -> None:
    rays = camera_rays(PANORAMA)
    poses = np.array([(5.8, 4.5, 0.4 + 0.01 * k) for k in range(4)])
    singly = np.array([render(demo, rays, pose, EYE).astype(float) for pose in poses])
    bright = (singly == 255).any(axis=0)  # the chip is full after all of them, not after each
    assert np.abs(render(demo, rays, poses, EYE) - singly.mean(axis=0))[~bright].max() <= 1.0
    np.testing.assert_allclose(shutter_times(Sensor(shutter=0.2, sub_exposures=4), 1.0), [0.925, 0.975, 1.025, 1.075])
    np.testing.assert_array_equal(shutter_times(Sensor(), 1.0), [1.0])


def test_what_the_grid_hides_is_what_looking_at_every_box_hides(demo: Scene) -> None:
    """With one cell that holds all boxes nothing is left out for being hidden, and the same picture comes out."""
    one = demo._replace(
        cell_start=np.array([0, len(demo.boxes)], dtype=np.int32),
        cell_boxes=np.arange(len(demo.boxes), dtype=np.int32),
        grid=np.array([-50.0, -50.0, 200.0]),
        rows=1,
        columns=1,
    )
    light = {"light": np.ones_like(demo.light), "contact": np.ones_like(demo.contact)}  # they hang on the grid's corner
    seen = [camera_rays(camera) for camera in (PANORAMA, camera_of(dataclasses.replace(DEMO, camera=mirror(320))))]
    for pose in ((5.8, 4.5, 0.4), (1.5, 7.4, -2.0), (10.0, 1.0, 1.6)):
        for eye in (0.3, 0.9, 2.5):
            for rays in seen:
                np.testing.assert_array_equal(
                    render(demo._replace(**light), rays, pose, eye), render(one._replace(**light), rays, pose, eye)
                )


def test_a_donut_without_a_mirror_model_has_no_rays() -> None:
    with pytest.raises(BadInput, match="a donut without centre_x"):
        camera_rays(Donut(width=10, height_px=10))

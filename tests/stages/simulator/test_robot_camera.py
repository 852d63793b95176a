"""The camera as it is against what camera.yaml says of it, exposure that jumps, ramps."""

from dataclasses import replace

import numpy as np
import pytest
from world_files import DEMO

from omninav.stages.recordings.recording import UnreadableRecording
from omninav.stages.simulator.cameras import camera_rays, leaning
from omninav.stages.simulator.config import CameraErrors, Ramps, Sensor, WorldConfig, mirror
from omninav.stages.simulator.renderer import render
from omninav.stages.simulator.robot_camera import RobotCamera, lean
from omninav.stages.simulator.scene import Scene
from omninav.stages.simulator.world import World

PLAIN = replace(DEMO, camera=mirror(160), sensor=Sensor(noise=0.0, exposure_drift=0.0))
POSE = np.array([[5.8, 4.5, 0.4]])
STRIP = {"projection": "cylindrical", "image": {"width": 90, "height": 30}, "height": 0.9,
         "column_of_forward": 45.0, "elevation": {"top": 0.4, "bottom": -0.4}}  # fmt: skip


@pytest.fixture(scope="module")
def scene() -> Scene:
    return World(PLAIN).scene


def upright(camera: RobotCamera, x: float = 0.0, heading: float = 0.0) -> np.ndarray:
    """Where the vertical of the camera points in the frame of the level robot, from its rays."""
    told = camera_rays(camera.described)
    rays = camera._rays_at(np.array([x, 0.0, heading]))
    row = np.argsort(rays.pixels)
    true, said = rays.directions[row].astype(float), told.directions[np.argsort(told.pixels)].astype(float)
    rotation = np.linalg.lstsq(said, true, rcond=None)[0].T
    return np.asarray(rotation @ (0.0, 0.0, 1.0))


def test_leaning_tips_the_vertical_towards_an_azimuth() -> None:
    up = lean(0.1, 2.0) @ (0.0, 0.0, 1.0)
    np.testing.assert_allclose(up, (np.sin(0.1) * np.cos(2.0), np.sin(0.1) * np.sin(2.0), np.cos(0.1)), atol=1e-12)
    np.testing.assert_allclose(lean(0.1, 2.0) @ lean(-0.1, 2.0), np.eye(3), atol=1e-12)


def test_a_camera_that_leans_by_nothing_takes_the_same_image(scene: Scene) -> None:
    rays = camera_rays(RobotCamera(PLAIN).described, 0.1, 0.25)
    np.testing.assert_array_equal(render(scene, leaning(rays, np.eye(3)), POSE, 0.9), render(scene, rays, POSE, 0.9))


def test_a_tilted_camera_leans_by_so_much_in_each_draw_elsewhere() -> None:
    ups = [
        upright(RobotCamera(replace(PLAIN, draw=draw, camera_errors=CameraErrors(tilt_deg=2.0)))) for draw in (0, 1, 2)
    ]
    for up in ups:
        assert np.degrees(np.arccos(up[2])) == pytest.approx(2.0, abs=0.01)
    assert len({round(float(np.arctan2(up[1], up[0])), 2) for up in ups}) == 3


def test_a_leaning_camera_sees_what_its_rays_point_at(scene: Scene) -> None:
    """Each pixel shows what the level camera shows where the pixel's turned ray is seen."""
    tilted = RobotCamera(replace(PLAIN, camera_errors=CameraErrors(tilt_deg=5.0)))
    level, leant = RobotCamera(PLAIN).image(scene, POSE, 0.0, 1), tilted.image(scene, POSE, 0.0, 1)
    up = upright(tilted)
    grid = tilted.described.grid()
    rays, looks = tilted.described.unproject(grid)
    rotation = lean(np.radians(5.0), float(np.arctan2(up[1], up[0])))
    at, shown = tilted.described.project(rays @ rotation.T)
    ring = tilted.described.shows(at) & shown & looks & tilted.described.shows(grid)
    seen = level[np.round(at[ring][:, 1]).astype(int), np.round(at[ring][:, 0]).astype(int)].astype(float)
    matched = np.abs(seen - leant[ring]).mean()
    assert matched < 0.5 * np.abs(level[ring].astype(float) - leant[ring]).mean()


def test_calibration_errors_change_the_camera_and_not_what_is_said_of_it() -> None:
    camera = RobotCamera(replace(PLAIN, camera_errors=CameraErrors(focal=0.005, centre_px=2.0)))
    told, true = RobotCamera(PLAIN).described, camera._true
    assert vars(camera.described) == vars(told)
    assert abs(true.focal_x / told.focal_x - 1.0) == pytest.approx(0.005)  # type: ignore[attr-defined]
    off = (true.centre_x - told.centre_x, true.centre_y - told.centre_y)  # type: ignore[attr-defined]
    assert np.hypot(*off) == pytest.approx(2.0)


def test_an_error_that_a_camera_cannot_have_is_refused() -> None:
    with pytest.raises(UnreadableRecording, match=r"world\.camera_errors\.focal: a cylindrical camera has no focal_x"):
        RobotCamera(replace(PLAIN, camera=STRIP, camera_errors=CameraErrors(focal=0.01)))


def test_exposure_jumps_and_holds(scene: Scene) -> None:
    sensor = replace(PLAIN.sensor, exposure_jumps=0.5, exposure_hold_s=4.0)
    camera = RobotCamera(replace(PLAIN, sensor=sensor), "tour", 1)
    factors = np.array([camera._exposure(second + 0.5) for second in range(400)])
    assert (factors.reshape(-1, 4) == factors[::4, None]).all()
    assert np.log2(factors[::4]).std() == pytest.approx(0.5, rel=0.2)
    darkest = int(factors.argmin())
    dark, bright = (camera.image(scene, POSE, at + 0.5, 1).mean() for at in (darkest, int(factors.argmax())))
    assert dark < 0.7 * bright


def test_on_ramps_the_camera_leans_back_where_the_floor_rises() -> None:
    camera = RobotCamera(replace(PLAIN, ramps=Ramps(slope_deg=2.0, period_m=16.0)))
    places = np.arange(0.0, 16.0, 0.5)
    ups = np.array([upright(camera, x) for x in places])
    slopes = np.degrees(np.arctan2(-ups[:, 0], ups[:, 2]))
    assert np.isclose(np.abs(slopes), 2.0, atol=0.01).mean() == pytest.approx(2 / 3, abs=0.1)
    assert slopes.max() == pytest.approx(-slopes.min()) == pytest.approx(2.0, abs=0.01)
    np.testing.assert_allclose(ups[:, 1], 0.0, atol=1e-5)
    aside = upright(camera, float(places[slopes.argmax()]), heading=np.pi / 2)  # its right-hand side is uphill
    np.testing.assert_allclose(aside, (0.0, np.sin(np.radians(2.0)), np.cos(np.radians(2.0))), atol=1e-4)


def test_without_errors_the_camera_is_the_one_that_is_described() -> None:
    camera = RobotCamera(WorldConfig())
    assert vars(camera._true) == vars(camera.described)
    np.testing.assert_array_equal(upright(camera), upright(camera, 3.0))

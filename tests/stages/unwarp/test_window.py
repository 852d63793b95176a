import math

import numpy as np
import pytest

from omninav.pipeline import BadInput, Context
from omninav.stages.camera.cylindrical import Cylindrical
from omninav.stages.camera.donut import Donut
from omninav.stages.camera.equirectangular import Equirectangular
from omninav.stages.camera.fisheye import Fisheye
from omninav.stages.camera.hyperbolic import HyperbolicMirror
from omninav.stages.camera.model import Camera
from omninav.stages.camera.perspective import Perspective
from omninav.stages.unwarp.table import remap_table
from omninav.stages.unwarp.window import PerspectiveWindow, window_rays
from omninav.stages.values.image import Image, Pixels, Windows

MIRROR = HyperbolicMirror(640, 480, 497.0, 497.0, 319.5, 239.5, 28.095, 23.4125, 34.0, 238.0, yaw=0.3)
FISHEYE = Fisheye(640, 480, 150.0, 319.5, 239.5, 238.0, 10.0, sense="counter_clockwise", yaw=0.3)
EQUIRECTANGULAR = Equirectangular(
    720, 240, 100.0, sense="counter_clockwise", elevation_top=math.radians(50), elevation_bottom=math.radians(-60)
)
CYLINDER = Cylindrical(720, 240, 360.0, elevation_top=math.radians(45), elevation_bottom=math.radians(-45))
PERSPECTIVE = Perspective(320, 240, 277.0, 277.0, 159.5, 119.5, yaw=0.5)


def windows(camera: Camera, pixels: Pixels, ctx: Context | None = None, **parameters) -> Windows:
    ctx, stage = ctx or Context("unwarp"), PerspectiveWindow(**parameters)
    stage.setup(ctx)
    return stage.step(ctx, Image(pixels), camera).panorama


def directions_seen(camera: Camera) -> np.ndarray:
    """The unit ray of each pixel of a camera's image that shows the world; zero elsewhere."""
    rays, _ = camera.unproject(camera.grid())
    return np.where(camera.mask()[..., None], rays, 0.0)


@pytest.mark.parametrize("pitch", [0.0, -20.0])
@pytest.mark.parametrize(
    "camera", [MIRROR, FISHEYE, EQUIRECTANGULAR, CYLINDER], ids=lambda camera: type(camera).__name__
)
def test_a_window_shows_what_its_rays_meet(camera: Camera, pitch: float) -> None:
    if isinstance(camera, Fisheye):
        pitch += 45.0  # it looks up
    picture = np.round(127.5 + 127.5 * directions_seen(camera)).astype(np.uint8)
    cut = windows(camera, picture, directions=5, field_deg=50.0, columns=80, rows=60, pitch_deg=pitch)
    assert np.allclose(np.mod(cut.headings, 2 * np.pi), np.mod(2 * np.pi * np.arange(5) / 5, 2 * np.pi))
    assert cut.field == pytest.approx(math.radians(50.0))
    for heading, pixels in zip(cut.headings, cut.pixels, strict=True):
        rays = window_rays(float(heading), math.radians(pitch), math.radians(50.0), 80, 60)
        rays /= np.linalg.norm(rays, axis=-1, keepdims=True)
        found = (pixels.astype(float) - 127.5) / 127.5
        lit = pixels.any(axis=2)
        assert lit.mean() > 0.9
        # half a grey level in 127.5, and half a pixel of a degree or less at the rim of what is seen
        assert np.quantile(np.abs(found - rays)[lit].max(axis=1), 0.99) < 0.012


def test_rays_of_a_level_window_are_a_pinhole_camera_s() -> None:
    # The axis itself, the right edge at half the field, and 45 degrees up where up equals the focal length.
    rays = window_rays(0.0, 0.0, math.radians(90.0), 4, 4)
    focal = 2.0
    assert np.allclose(rays[0, 0], (1.0, 1.5 / focal, 1.5 / focal))
    assert np.allclose(rays[3, 3], (1.0, -1.5 / focal, -1.5 / focal))
    turned = window_rays(math.pi / 2, 0.0, math.radians(90.0), 4, 4)
    assert np.allclose(turned[0, 0], (-1.5 / focal, 1.0, 1.5 / focal))
    up = window_rays(0.0, math.pi / 2, math.radians(90.0), 4, 4)
    assert np.allclose(up[0, 0], (-1.5 / focal, 1.5 / focal, 1.0))
    odd = window_rays(0.0, 0.0, math.radians(90.0), 4, 3)
    assert np.allclose(odd[1], [(1.0, left / focal, 0.0) for left in (1.5, 0.5, -0.5, -1.5)])


def test_pixels_that_are_not_shown_are_black_and_the_top_and_bottom_of_a_circle_are_its_own_rows() -> None:
    overhead = np.tile([0.0, 0.0, 1.0], (2, 3, 1))
    table, shown = remap_table(MIRROR, overhead)
    assert not shown.any()
    assert not table.remap(np.full((480, 640, 3), 255, np.uint8)).any()
    rows = np.zeros((240, 720, 3), np.uint8)
    rows[0], rows[-1] = 90, 200
    ends = EQUIRECTANGULAR.unproject(np.array([[[300.0, -0.4]], [[300.0, 239.4]]]))[0]
    assert remap_table(EQUIRECTANGULAR, ends)[0].remap(rows)[:, 0, 0].tolist() == [90, 200]


def test_what_the_camera_does_not_see_is_black_and_said() -> None:
    ctx, white = Context("unwarp"), np.full((480, 640, 3), 255, np.uint8)
    cut = windows(MIRROR, white, ctx, field_deg=100.0, columns=64, rows=48)
    assert cut.seen is not None
    assert (cut.pixels[~cut.seen] == 0).all()
    assert (cut.pixels[cut.seen] == 255).all()
    rays = window_rays(0.0, 0.0, math.radians(100.0), 64, 48)
    elevation = np.arctan2(rays[..., 2], np.hypot(rays[..., 0], rays[..., 1]))
    assert np.array_equal(cut.seen[0], elevation <= MIRROR.elevations[0])
    share = 100 * (1 - cut.seen.mean())
    assert f"{share:.1f} % of the windows are outside" in ctx.details["windows_beyond_the_camera"]
    inside = Context("unwarp")
    assert windows(MIRROR, white, inside, field_deg=50.0).seen is None
    assert not inside.details


def test_an_ordinary_camera_s_image_is_as_it_is() -> None:
    picture = np.random.default_rng(0).integers(0, 256, (240, 320, 3), dtype=np.uint8)
    same = windows(PERSPECTIVE, picture)
    assert np.array_equal(same.pixels[0], picture)
    assert same.headings.tolist() == [0.5]
    assert same.field == pytest.approx(2 * math.atan(160 / 277))
    assert windows(PERSPECTIVE, picture, columns=160, rows=120).pixels.shape == (1, 120, 160, 3)


def test_an_ordinary_camera_has_no_other_directions() -> None:
    with pytest.raises(BadInput, match=r"looks one way, not 4; write nodes.unwarp.directions=1"):
        windows(PERSPECTIVE, np.zeros((240, 320, 3), np.uint8), directions=4)


@pytest.mark.parametrize("camera", [Donut(640, 480, 319.5, 239.5, 34.0, 238.0), Cylindrical(720, 240, 360.0)])
def test_no_window_is_cut_where_elevations_are_not_known(camera: Camera) -> None:
    with pytest.raises(BadInput, match=r"no elevations .* give its model in camera.yaml .* or use unwarp=panorama"):
        windows(camera, np.zeros((camera.height_px, camera.width, 3), np.uint8))


def test_a_window_that_shows_nothing_is_refused() -> None:
    with pytest.raises(BadInput, match=r"sees nothing of a window .* set nodes.unwarp.pitch_deg and field_deg"):
        windows(MIRROR, np.zeros((480, 640, 3), np.uint8), pitch_deg=80.0, field_deg=20.0)

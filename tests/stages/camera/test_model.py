"""What every camera model has in common, by a model that a user wrote."""

import numpy as np
import pytest

from omninav.pipeline import BadInput
from omninav.stages.camera.cylindrical import Cylindrical
from omninav.stages.camera.donut import Donut
from omninav.stages.camera.fisheye import Fisheye
from omninav.stages.camera.model import MODELS, Camera, camera_models, require_elevations, require_sight, seen_at
from omninav.stages.camera.rays import angles, normalised, turned, unit_vectors
from omninav.stages.geometry.arrays import Array, Bools
from omninav.stages.recordings.camera_yaml import parse_camera


def test_all_models_of_the_folder_are_found_by_their_names_in_camera_yaml() -> None:
    found = camera_models()
    assert {"hyperbolic", "donut", "cylindrical", "equirectangular", "fisheye", "perspective"} <= set(found)
    assert {"double_sphere", "kannala_brandt", "ocamcalib", "unified"} <= set(found)
    assert all(model.projection == name for name, model in found.items())
    with pytest.raises(BadInput, match=r"'cylindrical' of .*Other is that of .*camera\.cylindrical\."):
        type("Other", (Camera,), {}, projection="cylindrical")
    assert camera_models() == found


def test_a_model_that_a_user_wrote_is_read_from_camera_yaml() -> None:
    class Orthographic(Camera, projection="orthographic"):
        """Parallel rays from above: radius = scale x cosine of the elevation."""

        scale: float

        def project(self, rays: Array) -> tuple[Array, Bools]:
            pixels = self.scale * normalised(rays)[..., :2] + (self.width / 2, self.height_px / 2)
            return pixels, self.shows(pixels) & (rays[..., 2] > 0.0)

        def unproject(self, pixels: Array) -> tuple[Array, Bools]:
            level = (pixels - (self.width / 2, self.height_px / 2)) / self.scale
            rest = 1.0 - (level**2).sum(axis=-1, keepdims=True)
            with np.errstate(invalid="ignore"):
                return np.concatenate([level, np.sqrt(rest)], axis=-1), rest[..., 0] >= 0.0

    try:
        camera = parse_camera("projection: orthographic\nimage: {width: 21, height: 21}\nscale: 8\n", "camera.yaml")
    finally:
        del MODELS["orthographic"]
    assert isinstance(camera, Orthographic)
    v, u = np.mgrid[0:21, 0:21] - 10.5
    assert np.array_equal(camera.mask(), np.hypot(u, v) <= 8.0)


def test_rays_that_the_image_does_not_show_are_seen_nowhere() -> None:
    camera = Fisheye(640, 480, 140.0, 318.0, 241.0, 230.0)
    seen = seen_at(camera, unit_vectors(np.array([0.0, 0.0]), np.array([0.8, -1.2])))
    assert np.isfinite(seen[0]).all()
    assert np.isnan(seen[1]).all()


def test_a_mount_is_what_the_description_states_and_bearings_are_turned_already() -> None:
    plain = Fisheye(640, 480, 140.0, 318.0, 241.0, 230.0)
    mounted = Fisheye(640, 480, 140.0, 318.0, 241.0, 230.0, position_y=-0.2, yaw=0.3, delay=0.0125)
    beside = Fisheye(640, 480, 140.0, 318.0, 241.0, 230.0, position_x=0.1)
    assert [*plain.mount, *mounted.mount, *beside.mount] == [0.0, 0.0, 0.0, 0.0, -0.2, 0.3, 0.1, 0.0, 0.0]
    assert [*mounted.arm, *beside.arm] == [0.0, -0.2, 0.0, 0.1, 0.0, 0.0]
    assert [camera.placed for camera in (plain, mounted, beside)] == [False, True, True]
    assert (plain.delay_ns, mounted.delay_ns) == (0, 12_500_000)


def test_a_ring_turned_inside_out_is_refused() -> None:
    with pytest.raises(ValueError, match=r"inner_radius_px' must be below"):
        Fisheye(640, 480, 140.0, 318.0, 241.0, 230.0, 240.0)


def test_pixels_are_shown_from_the_middle_of_the_first_to_that_of_the_last() -> None:
    edges = np.array([[0.0, 0.0], [119.0, 24.0], [-0.1, 9.0], [9.0, -0.1], [119.1, 9.0], [9.0, 24.1]])
    assert Cylindrical(120, 25, 60.0).shows(edges).tolist() == [True, True, False, False, False, False]


def test_a_camera_that_sees_next_to_nothing_or_a_part_of_its_circle_is_refused() -> None:
    require_sight(Fisheye(640, 480, 140.0, 318.0, 241.0, 230.0))
    require_sight(Fisheye(640, 480, 140.0, 180.0, 241.0, 230.0))  # cut at the left
    require_sight(Donut(640, 480))  # its ring is still to be found
    for x, radius, percent in ((-400.0, 230.0, "0"), (318.0, 9.8, "0.095")):  # of a cone of 4 degrees
        with pytest.raises(BadInput, match=rf"fisheye camera of 640 x 480 pixels sees {percent} % of all directions"):
            require_sight(Fisheye(640, 480, 140.0, x, 241.0, radius))
    with pytest.raises(BadInput, match=r"the ring around \(0, 241\) an image of 640 x 480 shows 50 % of all azimuths"):
        require_sight(Fisheye(640, 480, 140.0, 0.0, 241.0, 230.0, 40.0))


def test_who_needs_elevations_is_told_how_to_get_them() -> None:
    with pytest.raises(
        BadInput, match=r"no elevations are known .* cylindrical image.* give its model in camera\.yaml"
    ):
        require_elevations(Cylindrical(120, 25, 60.0))
    require_elevations(Cylindrical(120, 25, 60.0, elevation_top=0.4, elevation_bottom=-0.4))


def test_angles_undo_unit_vectors_and_turning_adds_to_azimuths() -> None:
    azimuth, elevation = angles(2.0 * turned(unit_vectors(0.4, -0.7), 0.5))
    assert (azimuth, elevation) == (pytest.approx(0.9), pytest.approx(-0.7))

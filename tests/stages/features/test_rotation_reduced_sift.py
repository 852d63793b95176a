"""Patches of a turned robot's views, on the mirror image and on the panorama, and of tilted images."""

import dataclasses
import math

import cv2
import numpy as np
import pytest
from turned_robot import CAMERA, both_kinds, look, wrapped

from omninav.pipeline import Context, Stage
from omninav.pipeline.graph.problems import BadInput
from omninav.stages.camera.dual_fisheye import DualFisheye
from omninav.stages.camera.equirectangular import Equirectangular
from omninav.stages.camera.model import Camera
from omninav.stages.features.affine_sift import AffineSift
from omninav.stages.features.rotation_reduced_sift import EDGE_RATIO, RotationReducedSift
from omninav.stages.geometry.appearance.mirrored_patches import mirrored_sift
from omninav.stages.unwarp.table import remap_table
from omninav.stages.values.image import Image, Panorama
from omninav.stages.values.local_features import LocalFeatures


def found(
    picture: Image | Panorama, camera: Camera = CAMERA, kind: type[Stage] = RotationReducedSift, **parameters: object
) -> LocalFeatures:
    stage, context = kind(**parameters), Context("features")
    stage.setup(context)
    features = stage.step(context, image=picture, camera=camera).features
    assert isinstance(features, LocalFeatures)
    return features


def mutual(one: LocalFeatures, other: LocalFeatures) -> tuple[np.ndarray, np.ndarray]:
    gaps = ((one.descriptors[:, None].astype(float) - other.descriptors[None].astype(float)) ** 2).sum(axis=-1)
    nearest = gaps.argmin(axis=1)
    first = np.flatnonzero(gaps.argmin(axis=0)[nearest] == np.arange(len(one)))
    return first, nearest[first]


def turned_off(one: LocalFeatures, other: LocalFeatures, turn: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Pairs that match, and by how much (rad) their azimuths differ otherwise than by the robot's turn."""
    first, second = mutual(one, other)
    azimuth = [np.arctan2(f.bearings[:, 1], f.bearings[:, 0]) for f in (one, other)]
    return first, second, np.abs(wrapped(azimuth[1][second] - azimuth[0][first] + turn))


@both_kinds
@pytest.mark.parametrize("turn", [0.7, 2.9])
def test_a_robot_that_turns_sees_the_same_patches_turned_the_other_way(kind: str, turn: float) -> None:
    one, other = found(look(kind, 0.0)), found(look(kind, turn))
    first, second, off = turned_off(one, other, turn)
    right = off < math.radians(1.5)
    assert right.sum() > 180
    assert right.mean() > 0.9
    assert np.median(off[right]) < math.radians(0.25)
    higher = np.arcsin(one.bearings[first, 2]) - np.arcsin(other.bearings[second, 2])
    assert np.median(np.abs(higher[right])) < math.radians(0.25)
    assert np.median(np.abs(one.colours[first][right] - other.colours[second][right])) < 0.02


@pytest.mark.parametrize("turn", [0.7, 2.9])
def test_with_own_orientation_a_turned_robot_sees_the_same_patches_too(turn: float) -> None:
    one, other = (found(look("mirror", each), orientation="own", contrast=0.01) for each in (0.0, turn))
    off = turned_off(one, other, turn)[2]
    assert (off < math.radians(0.5)).sum() > 150
    assert (off < math.radians(0.5)).mean() > 0.7


@pytest.mark.parametrize(("orientation", "right"), [("reduced", 190), ("own", 150)])
def test_two_fisheyes_side_by_side_see_the_same_patches_from_a_turned_robot(orientation: str, right: int) -> None:
    camera = DualFisheye.of_size(960, 480)
    sphere = Equirectangular(1024, 512, 512.0, elevation_top=math.pi / 2, elevation_bottom=-math.pi / 2)
    world = cv2.GaussianBlur(np.random.default_rng(0).integers(0, 255, (512, 1024, 3)).astype(np.uint8), (0, 0), 4.0)
    world = cv2.normalize(world, None, 0, 255, cv2.NORM_MINMAX)

    def view(turn: float) -> LocalFeatures:
        rays = dataclasses.replace(camera, yaw=turn).unproject(camera.grid())[0]
        image = Image(remap_table(sphere, rays)[0].remap(world))
        return found(image, camera, orientation=orientation, max_pixels=10**6)

    one, other = view(0.0), view(0.8)
    assert camera.shows(one.points).all()
    assert (turned_off(one, other, 0.8)[2] < math.radians(0.5)).sum() > right


@pytest.mark.parametrize("orientation", ["own", "reduced"])
def test_patches_of_a_mirror_are_a_panoramas_once_they_are_mirrored(orientation: str) -> None:
    kinds = ("mirror", "panorama")
    under, panorama = (found(look(kind, 0.4), orientation=orientation, contrast=0.01, blur_px=1.0) for kind in kinds)
    assert (under.mirrored, panorama.mirrored) == (True, False)
    back = dataclasses.replace(under, descriptors=mirrored_sift(under.descriptors))
    right, wrong = ((turned_off(each, panorama, 0.0)[2] < math.radians(1.0)).sum() for each in (back, under))
    assert right > 60
    assert right > 2 * wrong  # some patches are symmetric


def test_the_radius_stands_in_for_the_orientation_that_is_not_measured() -> None:
    one, other = found(look("mirror", 0.0)), found(look("mirror", math.pi / 2))
    upright = [found(Panorama(look("mirror", heading).pixels)) for heading in (0.0, math.pi / 2)]
    assert len(mutual(one, other)[0]) > 1.5 * len(mutual(*upright)[0])  # the same pictures, columns for radii


def test_of_a_turned_camera_the_bearings_are_the_robots() -> None:
    features = found(look("mirror", 0.0))
    level = features.points - (CAMERA.centre_x, CAMERA.centre_y)
    around = np.arctan2(level[:, 1], level[:, 0]) + CAMERA.yaw
    assert np.abs(wrapped(np.arctan2(features.bearings[:, 1], features.bearings[:, 0]) - around)).max() < 1e-9
    assert np.linalg.norm(features.bearings, axis=1) == pytest.approx(np.ones(len(features)))
    radius = np.hypot(*level.T)
    assert radius.min() > CAMERA.inner_radius_px
    assert radius.max() < CAMERA.outer_radius_px


def test_beyond_the_mirrors_edge_there_is_nothing_to_see() -> None:
    noise = np.random.default_rng(0).integers(0, 255, (480, 640, 3)).astype(np.uint8)
    larger = dataclasses.replace(CAMERA, focal_x=300.0, focal_y=300.0, outer_radius_px=400.0)  # than the mirror is
    assert np.isnan(larger.unproject(np.array([[638.0, 2.0]]))[0]).all()
    features = found(Image(noise), larger)
    assert len(features) > 10
    assert np.isfinite(features.bearings).all()


def test_patches_across_a_panoramas_seam_are_found_once() -> None:
    panorama = look("panorama", 0.0)
    rolled = Panorama(np.roll(panorama.pixels, 100, axis=1), panorama.elevation_top, panorama.elevation_bottom)
    one, other = found(panorama, max_pixels=10**6), found(rolled, max_pixels=10**6)
    moved = np.column_stack([(one.points[:, 0] + 100) % 720, one.points[:, 1]])
    gaps = np.abs(moved[:, None] - other.points[None]).max(axis=-1)
    assert (gaps.min(axis=1) < 0.5).mean() > 0.9
    assert (one.points[:, 0] >= -0.5).all()
    assert (one.points[:, 0] < 719.5).all()


def test_the_strongest_come_first_and_own_orientation_is_lowes() -> None:
    few, many = found(look("mirror", 0.0), max_features=50), found(look("mirror", 0.0), max_features=200)
    assert len(few) == 50
    assert (few.points == many.points[:50]).all()
    own = found(look("mirror", 0.0), orientation="own", max_features=50)
    assert not (own.descriptors == few.descriptors).all()


def test_a_picture_of_nothing_has_no_features_and_one_without_a_camera_is_refused() -> None:
    nothing = Panorama(np.zeros((80, 360, 3), np.uint8))
    assert found(nothing).descriptors.shape == (0, 128)
    assert len(found(nothing, orientation="own")) == 0
    stage = RotationReducedSift()
    stage.setup(Context("features"))
    with pytest.raises(BadInput, match=r"wires\.features\.camera=source\.camera"):
        stage.step(Context("features"), image=Image(np.zeros((48, 64, 3), np.uint8)))


def test_descriptors_of_own_orientation_are_those_of_their_points() -> None:
    picture = look("mirror", 0.4)
    own = found(picture, orientation="own", max_features=100, contrast=0.01, max_pixels=10**6)
    sift = cv2.SIFT.create(
        contrastThreshold=0.01, edgeThreshold=EDGE_RATIO, sigma=RotationReducedSift.blur_px, enable_precise_upscale=True
    )
    points, descriptors = sift.detectAndCompute(cv2.cvtColor(picture.pixels, cv2.COLOR_BGR2GRAY), None)
    known = {(*each.pt, row.astype(np.uint8).tobytes()) for each, row in zip(points, descriptors, strict=True)}
    assert len(own) == 100
    seen = {(*np.float32(at).tolist(), row.tobytes()) for at, row in zip(own.points, own.descriptors, strict=True)}
    assert seen <= known


def test_affine_features_of_tilted_images_are_found_beside_sifts_own() -> None:
    affine, plain = (
        found(look("mirror", 0.3), kind=kind, orientation="own", max_features=4000, max_pixels=20_000)
        for kind in (AffineSift, RotationReducedSift)
    )
    assert len(affine) > 2 * len(plain)
    gap = np.linalg.norm(affine.points[:, None] - plain.points[None], axis=2)
    assert (gap.min(axis=0) < 0.5).mean() > 0.9
    apart = np.linalg.norm(affine.descriptors[gap.argmin(axis=0)].astype(float) - plain.descriptors, axis=1)
    assert np.median(apart) < 50.0

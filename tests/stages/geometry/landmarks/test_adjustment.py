import math

import numpy as np
import pytest
from landmark_world import NOISE, POSE_SIGMAS, displaced, driven, house, misplaced, rotations, triangulated

from omninav.stages.geometry.landmarks.adjustment import Lens, Motions, adjusted
from omninav.stages.geometry.plane.drive_graph import odometry_sigmas
from omninav.stages.geometry.plane.se2 import between


def seen(world, poses, **options):
    return adjusted(
        poses,
        triangulated(world, poses[:, :3]),
        world.references,
        world.landmarks,
        options.pop("bearings", world.bearings),
        NOISE,
        **options,
    )


@pytest.fixture(scope="module")
def world():
    return house(np.random.default_rng(0))


@pytest.fixture(scope="module")
def wrong_poses(world):
    return displaced(world.poses, np.random.default_rng(1))


@pytest.fixture(scope="module")
def found(world, wrong_poses):
    return seen(world, wrong_poses, pose_sigmas=np.tile(POSE_SIGMAS, (len(wrong_poses), 1)))


def test_poses_that_are_wrong_by_10_cm_each_come_out_within_millimetres(world, wrong_poses, found):
    assert misplaced(wrong_poses, world.poses)[0] > 0.12
    error, scale = misplaced(found.poses, world.poses)
    assert error < 0.004
    assert scale == pytest.approx(1.0, abs=0.01)
    off = np.linalg.norm(found.points - world.points, axis=1)[np.bincount(world.landmarks, minlength=2000) > 2]
    assert np.median(off) < 0.04


def test_wrong_sightings_are_told_from_right_ones(world, found):
    alone = np.bincount(world.landmarks)[world.landmarks] == 1
    assert not found.inliers[alone].any()
    assert found.inliers[~alone & ~world.wrong].mean() > 0.97
    assert found.inliers[~alone & world.wrong].mean() < 0.1
    assert found.rms == pytest.approx(NOISE, rel=0.25)


def test_the_order_of_sightings_does_not_matter(world, wrong_poses, found):
    order = np.random.default_rng(2).permutation(len(world.references))
    sightings = (each[order] for each in (world.references, world.landmarks, world.bearings))
    sigmas = np.tile(POSE_SIGMAS, (len(wrong_poses), 1))
    again = adjusted(wrong_poses, triangulated(world, wrong_poses), *sightings, NOISE, sigmas)
    assert again.poses.tobytes() == found.poses.tobytes()
    assert again.points.tobytes() == found.points.tobytes()
    assert (again.inliers == found.inliers[order]).all()


def test_drifted_odometry_is_straightened_at_its_own_scale(world):
    steps, poses = driven(world.poses)
    edges = np.column_stack([np.arange(len(steps)), np.arange(1, len(poses))])
    assert misplaced(poses, world.poses)[0] > 0.3
    found = seen(world, poses, motions=Motions(edges, steps, odometry_sigmas(steps)))
    error, scale = misplaced(found.poses, world.poses)
    assert error < 0.004
    assert scale == pytest.approx(1.0 / 1.02, abs=0.002)
    assert found.poses[0] == pytest.approx(poses[0], abs=1e-6)
    assert np.abs(found.poses[:, 2]).max() <= math.pi


def test_fixed_poses_stay_and_the_rest_comes_to_them(world, wrong_poses):
    free = np.arange(len(wrong_poses)) % 3 == 1
    poses = np.where(free[:, None], wrong_poses, world.poses)
    found = seen(world, poses, pose_sigmas=np.where(free[:, None], np.full(3, np.inf), np.zeros(3)))
    assert np.abs(found.poses - poses)[~free].max() < 1e-6
    assert np.abs(found.poses - world.poses)[free, :2].max() < 0.02


def test_roll_and_pitch_are_found_where_they_are_free():
    rng = np.random.default_rng(3)
    tilts = rng.normal(0.0, math.radians(1.0), (120, 2))
    world = house(rng, tilts=tilts)
    poses = displaced(world.poses, rng)
    sigmas = np.tile([*POSE_SIGMAS, math.radians(1.0), math.radians(1.0), 0.02], (120, 1))
    flat = seen(world, poses, pose_sigmas=sigmas[:, :3])
    found = seen(world, np.column_stack([poses, np.zeros((120, 3))]), pose_sigmas=sigmas)
    assert misplaced(flat.poses, world.poses)[0] > 0.01
    assert misplaced(found.poses, world.poses)[0] < 0.005
    assert np.degrees(np.sqrt(((found.poses[:, 3:5] - tilts) ** 2).mean())) < 0.1


def test_a_parameter_of_the_camera_is_found_with_wrong_poses(world, wrong_poses):
    def tilted(corrections):  # all elevations are taken for 1 degree more than they are
        azimuth = np.arctan2(world.bearings[:, 1], world.bearings[:, 0])
        elevation = np.arcsin(world.bearings[:, 2]) + math.radians(1.0) + corrections[0]
        return np.column_stack(
            [np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)]
        )

    sigmas = np.tile(POSE_SIGMAS, (len(wrong_poses), 1))
    found = seen(world, wrong_poses, bearings=Lens(tilted, np.array([np.inf])), pose_sigmas=sigmas)
    assert np.degrees(found.camera[0]) == pytest.approx(-1.0, abs=0.02)
    assert misplaced(found.poses, world.poses)[0] < 0.004
    held = seen(world, wrong_poses, bearings=Lens(tilted, np.array([0.0])), pose_sigmas=sigmas)
    assert abs(held.camera[0]) < 1e-6


def test_what_nothing_is_known_of_stays(world, wrong_poses):
    first = world.references != 7  # a reference with no landmark
    once = first & ((world.landmarks != 5) | (np.arange(len(first)) == np.flatnonzero(world.landmarks == 5)[0]))
    points = triangulated(world, wrong_poses)
    found = adjusted(wrong_poses, points, world.references[once], world.landmarks[once], world.bearings[once], NOISE)
    assert found.poses[7] == pytest.approx(wrong_poses[7], abs=1e-9)
    assert found.points[5] == pytest.approx(points[5], nan_ok=True)
    assert np.isfinite(found.poses).all()
    assert not (found.poses[8] == wrong_poses[8]).all()


def test_a_landmark_that_one_reference_sees_twice_moves_no_pose():
    bearings = np.array([[0.8, 0.6, 0.0], [0.6, 0.8, 0.0]])
    poses, points = np.zeros((2, 3)), np.array([[3.0, 3.0, 0.0]])
    found = adjusted(poses, points, np.array([1, 1]), np.array([0, 0]), bearings, 0.1, np.full((2, 3), 1.0))
    assert found.poses == pytest.approx(poses, abs=1e-9)


@pytest.mark.parametrize("sightings", [0, 1])
def test_without_anything_seen_twice_nothing_changes(world, sightings):
    some = (each[:sightings] for each in (world.references, world.landmarks, world.bearings))
    found = adjusted(world.poses, world.points, *some, NOISE)
    assert (found.poses == world.poses).all()
    assert (found.points == world.points).all()
    assert not found.inliers.any()
    assert math.isnan(found.rms)
    assert np.isinf(found.covariances(1.0)).all()


def drawn_again(world, rng):
    """The bearings of a house without wrong ones, with other noise."""
    poses, points = world.poses[world.references], world.points[world.landmarks]
    rays = points - np.column_stack([poses[:, :2], np.zeros(len(poses))])
    bearings = np.einsum("oji,oj->oi", rotations(world.poses)[world.references], rays)
    bearings = bearings / np.linalg.norm(bearings, axis=1)[:, None] + rng.normal(0.0, NOISE, bearings.shape)
    return bearings / np.linalg.norm(bearings, axis=1)[:, None]


def fitted_errors(poses, truth):
    """Errors (R, 3) of poses in the frame that fits their places best."""
    one, two = ((each[:, 0] + 1j * each[:, 1]) - each[:, :2].mean(axis=0) @ [1, 1j] for each in (poses, truth))
    turn = (one.conj() * two).sum()
    turn /= abs(turn)
    away = turn * one - two
    headings = np.angle(np.exp(1j * (poses[:, 2] - truth[:, 2])) * turn)
    return np.column_stack([away.real, away.imag, headings])


@pytest.mark.parametrize("held", [False, True])
def test_covariances_are_those_of_the_errors_over_many_draws(held):
    world, rng = house(np.random.default_rng(0), 40, 300, 0.0), np.random.default_rng(1)
    steps = between(world.poses[:-1], world.poses[1:])
    edges, sigmas = np.column_stack([np.arange(39), np.arange(1, 40)]), odometry_sigmas(steps)
    told, errors = [], []
    for _ in range(40):
        measured = world._replace(bearings=drawn_again(world, rng))
        if held:
            given = world.poses + rng.normal(size=(40, 3)) * POSE_SIGMAS
            options = {"pose_sigmas": np.tile(POSE_SIGMAS, (40, 1)), "given": given}
        else:
            options = {"motions": Motions(edges, steps + rng.normal(size=steps.shape) * sigmas, sigmas)}
        found = seen(measured, world.poses, **options)
        told.append(np.diagonal(found.covariances(1.0), axis1=1, axis2=2))
        errors.append(found.poses - world.poses if held else fitted_errors(found.poses, world.poses))
    ratio = (np.square(errors).mean(axis=0) / np.mean(told, axis=0)).mean(axis=0)
    assert ratio == pytest.approx([1.0, 1.0, 1.0], abs=0.35)


def test_of_many_references_the_covariance_is_that_of_the_nearest_computed_one(world, wrong_poses, monkeypatch):
    sigmas = np.tile(POSE_SIGMAS, (len(wrong_poses), 1))
    every = seen(world, wrong_poses, pose_sigmas=sigmas).covariances(1.0)
    monkeypatch.setattr("omninav.stages.geometry.landmarks.adjustment.MAX_COVARIANCES", 5)
    some = seen(world, wrong_poses, pose_sigmas=sigmas).covariances(1.0)
    assert every.shape == some.shape == (120, 3, 3)
    rows = np.linspace(0, 119, 5).astype(int)
    nearest = rows[np.abs(np.arange(120)[:, None] - rows).argmin(axis=1)]
    assert some == pytest.approx(every[nearest], rel=1e-6)

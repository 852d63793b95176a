"""Relative poses, camera poses and homing, at the sizes of Goedemé et al. 2007: 100 bearings, half wrong; 320x240."""

import math
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import poselib

from omninav.pipeline import Context
from omninav.stages.features.rotation_reduced_sift import RotationReducedSift
from omninav.stages.geometry.two_views.absolute_pose import three_point_pose
from omninav.stages.geometry.two_views.epipolar import planar_candidates
from omninav.stages.geometry.two_views.relative_pose_ransac import relative_pose
from omninav.stages.homing.feature_tracker import FeatureTracker, FeatureTrackerState
from omninav.stages.homing.homing_vector import HomingVectorFromMap
from omninav.stages.homing.local_mapping import LocalMapping, LocalMappingState
from omninav.stages.match.correspondences import MatchFeatures
from omninav.stages.simulator.cameras import camera_of, camera_rays
from omninav.stages.simulator.config import mirror
from omninav.stages.simulator.renderer import render
from omninav.stages.simulator.world import World
from omninav.stages.values.correspondences import Correspondences
from omninav.stages.values.homing import HomingTarget
from omninav.stages.values.image import Image
from omninav.stages.values.local_features import LocalFeatures

from .renderer import world_config
from .table import Row, medians, milliseconds

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))
from two_views import angle_deg, two_views, unit

SCENES = 200
STORE = world_config("home_store_demo")
CAMERA = camera_of(replace(STORE, camera=mirror(columns=320)))


def rows() -> list[Row]:
    """Relative poses, camera poses and homing."""
    return [*_relative(), *_absolute(), *_homing()]


def _relative() -> list[Row]:
    scenes = [two_views(seed, 100, wrong=0.5, noise_deg=0.1) for seed in range(SCENES)]
    errors: dict[str, list[tuple[float, float]]] = {"planar": [], "five_point": []}
    for solver, found in errors.items():
        for seed, (rotation, translation, first, second) in enumerate(scenes[: SCENES if solver == "planar" else 50]):
            pose = relative_pose(first, second, np.random.default_rng(seed), solver)  # type: ignore[arg-type]
            assert pose is not None
            found.append((angle_deg(pose.rotation, rotation), angle_deg(pose.translation, translation)))
    two, five = np.array(errors["planar"]), np.array(errors["five_point"])
    _, _, first, second = scenes[0]
    upright = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])  # our z is poselib's y
    here, there = (np.ascontiguousarray(b[50:52] @ upright.T) for b in (first, second))
    taken = medians(
        {
            solver: lambda solver=solver: relative_pose(first, second, np.random.default_rng(0), solver)
            for solver in ("planar", "five_point")
        }
    )
    eight = medians({"eight": lambda: relative_pose(first, second, np.random.default_rng(0), "eight_point")}, rounds=3)
    inner = medians(
        {
            "ours": lambda: planar_candidates(first, second, np.array([[50, 51]])),
            "theirs": lambda: poselib.relpose_upright_planar_2pt(there, here),
        },
        inner=50,
    )
    what, peer = "relative pose, 100 bearings, half of them wrong", "by five points (poselib's)"
    ours, theirs = (np.median(errors_of, axis=0).tolist() for errors_of in (two, five))
    within = 100.0 * float((two.max(axis=1) < 3).mean())
    return [
        milliseconds(f"{what}: two points", taken["planar"], limit=5.0),
        Row("… runs within 3 degrees", within, "%", limit=100.0, higher_is_better=True),
        Row("… median error of the direction", ours[1], "deg", peer, theirs[1], limit=1.0, of_peer=True),
        Row("… median error of the rotation", ours[0], "deg", peer, theirs[0], limit=1.0, of_peer=True),
        milliseconds(f"{what}: five points", taken["five_point"]),
        milliseconds(f"{what}: eight points", eight["eight"]),
        Row("one sample of two points", inner["ours"] * 1e6, "us", "poselib upright_planar_2pt", inner["theirs"] * 1e6),
    ]


def _absolute() -> list[Row]:
    rng = np.random.default_rng(0)
    points = rng.uniform([-3.0, -3.0, 2.0], [3.0, 3.0, 8.0], (100, 3))  # before a pinhole camera, which the peer wants
    bearings = unit(unit(points) + 0.001 * rng.normal(size=(100, 3)))
    bearings[:50] = unit(np.append(rng.uniform(-1, 1, (50, 2)), np.ones((50, 1)), axis=1))
    flat = bearings[:, :2] / bearings[:, 2:]
    camera = {"model": "PINHOLE", "width": 2, "height": 2, "params": [1.0, 1.0, 0.0, 0.0]}
    options = {"max_reproj_error": math.tan(math.radians(0.5)), "success_prob": 0.9999}
    functions = {
        "ours": lambda: three_point_pose(bearings, points, np.random.default_rng(0)),
        "theirs": lambda: poselib.estimate_absolute_pose(flat, points, camera, options, {}),
    }
    taken, what = medians(functions), "camera pose, 100 points, half of them wrong"
    return [milliseconds(what, taken["ours"], "poselib (pinhole)", taken["theirs"])]


def _homing() -> list[Row]:
    camera, rays, scene = CAMERA, camera_rays(CAMERA), World(STORE).scene
    way = np.linspace((4.0, 4.2, -0.5), (4.8, 4.84, 0.3), 12)
    images = [Image(render(scene, rays, tuple(pose), 0.9)) for pose in way]
    sift, match, ctx = RotationReducedSift(), MatchFeatures(), Context("homing")
    sift.setup(ctx)
    match.setup(ctx)
    seen = [sift.step(ctx, image, camera).features for image in images]
    goal = sift.step(ctx, Image(render(scene, rays, (5.0, 5.0, 0.4), 0.9)), camera).features
    target, tracker, mapping, homing = HomingTarget(0, goal), FeatureTracker(), LocalMapping(), HomingVectorFromMap()
    pairs = [match.step(ctx, features, goal).correspondences for features in seen]

    def begin(features: LocalFeatures = seen[0], found: Correspondences = pairs[0]) -> None:
        own = Context("h", np.random.default_rng(0))
        tracker.step(own, FeatureTrackerState(), images[0], camera)
        out = mapping.step(own, LocalMappingState(), features, target, found)
        homing.step(own, out.map)

    def begin_all() -> None:
        features = sift.step(ctx, images[0], camera).features
        begin(features, match.step(ctx, features, goal).correspondences)

    def drive() -> None:
        tracked, mapped, own = FeatureTrackerState(), LocalMappingState(), Context("h", np.random.default_rng(0))
        local_map = None
        for image, features, found in zip(images, seen, pairs, strict=True):
            tracks = tracker.step(own, tracked, image, camera, local_map).tracks
            local_map = mapping.step(own, mapped, features, target, found, tracks).map
            vector = homing.step(own, local_map).vector
        assert vector is not None
        assert vector.state == "tracking"

    taken = medians({"begin": begin, "begin_all": begin_all, "drive": drive}, rounds=15)
    return [
        milliseconds("homing, 320x240: an update", (taken["drive"] - taken["begin"]) / (len(way) - 1), limit=25.0),
        milliseconds("homing, 320x240: a new target", taken["begin"], limit=100.0),
        milliseconds("… with features and matching", taken["begin_all"], limit=100.0),
    ]

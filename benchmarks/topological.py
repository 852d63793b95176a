"""What a topological map costs: the features of a pair of views and their matches, a map of a tour, a look at it."""

import math
import time

import cv2
import numpy as np

from omninav.pipeline import Context, Tick
from omninav.pipeline.engine.codec import encode
from omninav.stages.camera.hyperbolic import HyperbolicMirror
from omninav.stages.features.rotation_reduced_sift import RotationReducedSift
from omninav.stages.features.vertical_segments import FindVerticalSegments
from omninav.stages.geometry.appearance.feature_matching import mahalanobis_matches
from omninav.stages.geometry.appearance.visual_distance import ComparisonOptions, match_patches
from omninav.stages.mapping.loop_closure import LoopClosure
from omninav.stages.mapping.topological import TopologicalMapping
from omninav.stages.mapping.view_comparison import ViewComparison
from omninav.stages.match.visual_distance import VisualDistance
from omninav.stages.simulator.cameras import camera_of, camera_rays
from omninav.stages.simulator.renderer import render
from omninav.stages.simulator.world import World
from omninav.stages.values.image import Image, Pixels
from omninav.stages.values.local_features import GlobalDescriptor, LocalFeatures
from omninav.stages.values.pose import Pose
from omninav.stages.values.topological_map import TopologicalMap

from .renderer import world_config
from .table import Row, medians, milliseconds

IMAGES, PLACES = 545, 60
GREY = GlobalDescriptor(np.zeros(3, np.float32))
"""Of every view: no two can be told apart at a glance."""


def rows() -> list[Row]:
    """A pair of views, and a map of many."""
    return [*_pair(), *_map()]


def two_views() -> tuple[list[Pixels], HyperbolicMirror]:
    """Two views of the built-in world, 320 x 240, half a metre apart and turned, and their camera."""
    store = world_config("home_store_demo")
    camera = camera_of(store)
    assert isinstance(camera, HyperbolicMirror)
    scene, rays = World(store).scene, camera_rays(camera)
    seen = [render(scene, rays, pose, 0.9) for pose in ((5.0, 5.0, 0.0), (5.5, 5.2, 0.6))]
    half = HyperbolicMirror(
        320, 240, camera.focal_x / 2, camera.focal_y / 2, 159.5, 119.5, camera.a, camera.b,
        camera.inner_radius_px / 2, camera.outer_radius_px / 2, height=camera.height, yaw=camera.yaw,
    )  # fmt: skip
    return [cv2.resize(pixels, (320, 240), interpolation=cv2.INTER_AREA) for pixels in seen], half


def _pair() -> list[Row]:
    pictures, camera = two_views()
    sift, finder, context = RotationReducedSift(), FindVerticalSegments(), Context("features")
    sift.setup(context)
    own = cv2.SIFT.create(nfeatures=sift.max_features, contrastThreshold=sift.contrast)
    brute = cv2.BFMatcher(cv2.NORM_L2)

    def patches() -> list[LocalFeatures]:
        return [sift.step(context, image=Image(pixels), camera=camera).features for pixels in pictures]

    def both() -> int:
        first, second = patches()
        here, there = (finder.step(context, image=Image(each), camera=camera).vertical_segments for each in pictures)
        pairs = match_patches(first.patches(), second.patches(), ComparisonOptions())
        return len(pairs.first) + len(mahalanobis_matches(here.descriptors, there.descriptors, 0.8).first)

    def plain() -> int:
        found = [own.detectAndCompute(cv2.cvtColor(pixels, cv2.COLOR_BGR2GRAY), None)[1] for pixels in pictures]
        return sum(a.distance < 0.8 * b.distance for a, b in brute.knnMatch(*found, k=2))

    taken = medians({"both": both, "patches": patches, "plain": plain}, rounds=11)
    what, peer = "patches and vertical segments of two views of 320x240, matched", "cv2.SIFT, cv2.BFMatcher of both"
    return [
        milliseconds(what, taken["both"], peer, taken["plain"], limit=40.0),
        milliseconds("patches of both alone, with bearings and colours", taken["patches"]),
    ]


def a_tour(images: int, landmarks: int = 6000, seen: int = 200) -> tuple[list[LocalFeatures], list[Pose]]:
    """Features along two rounds of a made-up place: of the landmarks around, each with a look of its own."""
    rng = np.random.default_rng(0)
    where = rng.uniform((0.0, 0.0, 0.0), (60.0, 60.0, 3.0), (landmarks, 3))
    looks = rng.integers(0, 100, (landmarks, 128)).astype(np.uint8)
    colours = rng.uniform(-1.0, 1.0, (landmarks, 3)).astype(np.float32)
    around = 4.0 * math.pi * np.arange(images) / images
    poses = [Pose(30.0 + 22.0 * math.cos(a), 30.0 + 22.0 * math.sin(a), a + math.pi / 2) for a in around]
    views = []
    for pose in poses:
        gap = where - (pose.x, pose.y, 0.9)
        near = np.argsort(np.hypot(gap[:, 0], gap[:, 1]), kind="stable")[:seen]
        cos, sin = math.cos(pose.heading), math.sin(pose.heading)
        turned = gap[near] @ np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
        bearings = turned / np.linalg.norm(turned, axis=1, keepdims=True)
        sizes = np.full(seen, 4.0, np.float32)
        noise = rng.integers(0, 12, (seen, 128)).astype(np.uint8)
        views.append(LocalFeatures(bearings, np.zeros((seen, 2)), looks[near] + noise, colours[near], sizes))
    return views, poses


def map_of(
    views: list[LocalFeatures], poses: list[Pose], ticks: list[Tick], comparison: ViewComparison, closure: LoopClosure
) -> TopologicalMap:
    """The map of a tour."""
    given = {"ticks": ticks, "features": views, "descriptor": [GREY] * len(views), "truth": poses}
    compared = comparison.step(Context("views"), **given).views
    found = closure.step(Context("loops"), compared).hypotheses
    return TopologicalMapping().step(Context("mapping"), compared, found).map


def _map() -> list[Row]:
    views, poses = a_tour(IMAGES)
    ticks = [Tick(row, row * 10**9) for row in range(IMAGES)]
    start = time.process_time()
    made = map_of(views, poses, ticks, ViewComparison(), LoopClosure())
    taken = time.process_time() - start
    size = len(encode(made)) / len(made.views) * PLACES / 1e6
    first, apart = (views[:PLACES], poses[:PLACES], ticks[:PLACES]), LoopClosure(place_size=1e-6, min_support=1.0)
    few = map_of(*first, ViewComparison(every_s=0.0), apart)
    assert len(few) == PLACES
    match, context = VisualDistance(), Context("match")
    match.setup(context)
    look = medians({"look": lambda: match.step(context, views[-1], GREY, few)}, rounds=15)["look"]
    return [
        Row(f"map of {IMAGES} views, 200 patches each, none told apart at a glance", taken, "s CPU", limit=180.0),
        Row(f"{PLACES} views of it in a file", size, "MB", limit=1.68),
        milliseconds(f"visual distance of a view to {PLACES} places", look, limit=100.0),
    ]

"""What a picture costs: unwarping, comparing with a map, comparing with what particles expect."""

import itertools

import cv2
import numpy as np

from omninav.pipeline import Context
from omninav.stages.camera.hyperbolic import HyperbolicMirror
from omninav.stages.features.hsv_histogram import HsvHistogram
from omninav.stages.match.selective import SelectiveMatch
from omninav.stages.unwarp.panorama import UnwarpPanorama
from omninav.stages.values.belief import Particles
from omninav.stages.values.features import SegmentHistograms
from omninav.stages.values.image import Image, Panorama
from omninav.stages.values.maps import ReferenceGraph

from .table import Row, medians, milliseconds

CAMERA = HyperbolicMirror(640, 480, 497.0, 497.0, 319.5, 239.5, 28.095, 23.4125, 34.0, 238.0, height=0.9, yaw=0.3)


def rows() -> list[Row]:
    """Unwarping, features and matches."""
    return [*_unwarp(), _features(), *_match()]


def _unwarp() -> list[Row]:
    ctx = Context("unwarp")
    picture = np.random.default_rng(0).integers(0, 255, (480, 640, 3), dtype=np.uint8)
    picture = cv2.GaussianBlur(picture, (9, 9), 3)
    stage = UnwarpPanorama()
    stage.setup(ctx)
    image = Image(picture)
    panorama = stage.step(ctx, image, CAMERA).panorama.pixels
    rows, columns = panorama.shape[:2]
    angle = np.linspace(0, 2 * np.pi, columns, endpoint=False)[None, :]
    radius = np.linspace(40, 230, rows)[:, None]
    x = (319.5 + radius * np.cos(angle)).astype(np.float32)
    y = (239.5 + radius * np.sin(angle)).astype(np.float32)
    fixed = cv2.convertMaps(x, y, cv2.CV_16SC2)
    functions = {
        "ours": lambda: stage.step(ctx, image, CAMERA),
        "remap": lambda: cv2.remap(picture, *fixed, cv2.INTER_LINEAR),
    }
    taken, what, peer = medians(functions, rounds=200), "unwarp 640x480 -> 360x80", "cv2.remap alone, fixed point"
    return [milliseconds(what, taken["ours"], peer, taken["remap"], limit=1.3, of_peer=True)]


def _features() -> Row:
    ctx = Context("features")
    pixels = cv2.GaussianBlur(np.random.default_rng(1).integers(0, 255, (80, 360, 3), dtype=np.uint8), (5, 5), 2)
    stage, panorama = HsvHistogram(segments=10), Panorama(pixels)
    edges = np.linspace(0, 360, 11).astype(int)

    def peer() -> None:
        hsv = cv2.cvtColor(pixels, cv2.COLOR_BGR2HSV)
        for start, end in itertools.pairwise(edges):
            part = np.ascontiguousarray(hsv[:, start:end])
            cv2.calcHist([part], [0], None, [16], [0, 180])
            cv2.calcHist([part], [2], None, [4], [0, 256])

    taken = medians({"ours": lambda: stage.step(ctx, panorama), "peer": peer}, rounds=200)
    return milliseconds("HSV histograms, 10 segments of 360x80", taken["ours"], "cv2.calcHist in a loop", taken["peer"])


def histograms(rng: np.random.Generator, *shape: int) -> np.ndarray:
    """Random histograms that sum to 1 along the last axis."""
    values = rng.random(shape).astype(np.float32) ** 4
    return values / values.sum(axis=-1, keepdims=True)


def _match() -> list[Row]:
    rng, ctx = np.random.default_rng(2), Context("match")
    poses = np.column_stack([rng.uniform(0, 100, 3500), rng.uniform(0, 60, 3500), rng.uniform(-3, 3, 3500)])
    whole = ReferenceGraph(poses, histograms(rng, 3500, 36, 20), "histograms", np.zeros((0, 2), np.int64), "truth")
    ten = ReferenceGraph(poses, histograms(rng, 3500, 10, 20), "histograms", np.zeros((0, 2), np.int64), "truth")
    view, view_ten = SegmentHistograms(histograms(rng, 36, 20)), SegmentHistograms(histograms(rng, 10, 20))
    stage = SelectiveMatch()
    spot = np.array([50.0, 30.0, 0.0]) + rng.normal(0, 0.3, (5000, 3))
    near = Particles(spot, np.full(5000, 1 / 5000))
    functions = {
        "cold": lambda: stage.step(ctx, view, whole),
        "cold ten": lambda: stage.step(ctx, view_ten, ten),
        "tracking": lambda: stage.step(ctx, view, whole, near),
    }
    taken = medians(functions, rounds=15)
    what = "one view against 3500 references at 36 headings"
    return [
        milliseconds(f"{what}, cold, 36 segments", taken["cold"], limit=50.0),
        milliseconds(f"{what}, cold, 10 segments", taken["cold ten"], limit=50.0),
        milliseconds(f"{what}, tracking", taken["tracking"], limit=10.0),
    ]

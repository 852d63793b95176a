"""What a query of the image database costs: its Haar integrals, and the comparison with all images."""

import math

import cv2
import numpy as np

from omninav.pipeline import Context
from omninav.stages.features.haar_integral import HaarIntegral
from omninav.stages.geometry.appearance.haar_integrals import Kernel, padded
from omninav.stages.match.retrieval import Retrieval
from omninav.stages.values.features import SegmentHistograms
from omninav.stages.values.image import Panorama, Windows
from omninav.stages.values.maps import ReferenceGraph

from .images import histograms
from .table import Row, medians, milliseconds

IMAGES = 936
KERNEL = Kernel((3.0, 4.0))


def a_picture(rows: int, columns: int) -> np.ndarray:
    pixels = np.random.default_rng(0).integers(0, 256, (rows, columns, 3), dtype=np.uint8)
    return cv2.normalize(cv2.GaussianBlur(pixels, (0, 0), 4), None, 0, 255, cv2.NORM_MINMAX)


def looped(pixels: np.ndarray) -> np.ndarray:
    """The integral as a loop of shifted pictures: what OpenCV is made for."""
    rows, columns = pixels.shape[:2]
    picture = pixels.astype(np.float32) * np.float32(1 / 255)
    total = np.zeros_like(picture)
    for p in range(KERNEL.angles):
        angle = 2 * math.pi * p / KERNEL.angles
        factors = []
        for radius, turn in zip(KERNEL.radii, (0.0, math.pi / 2), strict=True):
            to = np.array([[1, 0, radius * math.cos(angle + turn)], [0, 1, radius * math.sin(angle + turn)]])
            how = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
            factors.append(cv2.warpAffine(picture, to, (columns, rows), flags=how, borderMode=cv2.BORDER_WRAP))
        total += factors[0] * factors[1]
    return total / KERNEL.angles


def rows() -> list[Row]:
    """A Haar integral, and whole queries."""
    return [_integral(), *_query()]


def _integral() -> Row:
    pixels = a_picture(240, 320)

    def ours() -> np.ndarray:
        return KERNEL.means(padded(pixels, KERNEL.margin + 1, True, True))

    assert np.allclose(ours(), looped(pixels), atol=1e-4)
    taken = medians({"ours": ours, "peer": lambda: looped(pixels)}, rounds=15)
    what, peer = "Haar integral, 320x240x3, one kernel, 36 angles", "a loop of cv2.warpAffine"
    return milliseconds(what, taken["ours"], peer, taken["peer"], limit=1.0, of_peer=True)


def _query() -> list[Row]:
    rng, ctx = np.random.default_rng(1), Context("query")
    window = Windows(a_picture(240, 320)[None], np.zeros(1), 1.0)
    panorama = Panorama(a_picture(80, 360))
    stage, of_windows, of_panoramas = HaarIntegral(), Retrieval(), Retrieval()  # each is calibrated for one map
    sampled = HaarIntegral(integration="monte_carlo")
    maps = {}
    for name, picture in (("window", window), ("panorama", panorama)):
        features = histograms(rng, IMAGES, *stage.step(ctx, picture).features.values.shape)
        edges = np.zeros((0, 2), np.int64)
        maps[name] = ReferenceGraph(rng.uniform(0, 30, (IMAGES, 3)), features, "histograms", edges, "truth")
    dense = SegmentHistograms(histograms(rng, 8, 125))
    taken = medians(
        {
            "window": lambda: of_windows.step(ctx, stage.step(ctx, window).features, maps["window"]),
            "panorama": lambda: of_panoramas.step(ctx, stage.step(ctx, panorama).features, maps["panorama"]),
            "dense": lambda: of_panoramas.step(ctx, dense, maps["panorama"]),
            "features": lambda: stage.step(ctx, window),
            "sampled": lambda: sampled.step(ctx, window),
        },
        rounds=15,
    )
    what = f"query against {IMAGES} images, features included"
    return [
        milliseconds(f"{what}: a window of 320x240", taken["window"], limit=30.0),
        milliseconds(f"{what}: a panorama of 360x80, 8 sectors, 36 headings", taken["panorama"], limit=30.0),
        milliseconds("comparison alone, no bin of which is empty, 8 sectors, 36 headings", taken["dense"], limit=30.0),
        milliseconds("Haar-integral histogram of a window of 320x240", taken["features"]),
        milliseconds("the same at 2000 random pixels", taken["sampled"]),
    ]

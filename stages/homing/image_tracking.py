"""Points from one image to the next: which can be tracked, where they are now, and where lost ones are found again.

Goedemé et al. 2007, sections 7.2.1 and 7.2.2: the most trackable point close to a feature is followed (Shi and Tomasi,
Lucas and Kanade: OpenCV's). A lost one is searched around its expected position by the histogram of its intensities,
which does not change where a mirror image turns. Points are columns and rows without the repeated ones of a
`WorkingImage`.
"""

from typing import Any, cast

import cv2
import numpy as np

from omninav.stages.geometry.arrays import Array, Bools, Bytes, Floats

from .working_image import WorkingImage

HISTOGRAM_BINS = 16
"""Bins of the histogram of the intensities around a point."""
START_RADIUS_PX = 3
"""Radius around a feature within which the most trackable point is chosen, pixels."""
WINDOW_PX = 15
"""Side of the window that Lucas and Kanade's method compares, pixels."""
PYRAMID_LEVELS = 3
"""Times that the image is halved for large displacements."""
MAX_FORWARD_BACKWARD_PX = 1.0
"""Largest forward-backward error of a tracked point, pixels."""
SEARCH_RADIUS_PX = 8.0
"""Radius around its expected position in which a lost point is searched, pixels."""
PATCH_RADIUS_PX = 5
"""Radius of the disc whose intensity histogram describes a point, pixels."""
MAX_HISTOGRAM_DIFFERENCE = 0.25
"""Largest difference of histograms at which a lost point is recognised: half the sum of absolute differences."""
MIN_TRACKABILITY = 0.01
"""Smallest trackability at which a lost point is searched, as a share of the image's largest."""


def trackability(image: WorkingImage) -> Floats:
    """The smaller eigenvalue of the gradients' matrix around each pixel of `grey` (equation 18): (rows, columns)."""
    return cast(Floats, cv2.cornerMinEigenVal(image.grey, blockSize=5, ksize=3))


def best_nearby(strength: Floats, image: WorkingImage, points: Array) -> Array:
    """For points (N, 2) the most trackable pixels (N, 2) at most `START_RADIUS_PX` rows and columns away, if inside."""
    steps = np.arange(-START_RADIUS_PX, START_RADIUS_PX + 1)
    offsets = np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2)
    near = np.rint(points).astype(np.int64)[:, None, :] + offsets
    rows, columns = strength.shape
    x, y = near[..., 0] + image.seam, near[..., 1]
    there = (x >= 0) & (x < columns) & (y >= 0) & (y < rows)
    found = np.where(there, strength[np.clip(y, 0, rows - 1), np.clip(x, 0, columns - 1)], -1.0)
    return np.asarray(near[np.arange(len(points)), np.argmax(found, axis=1)], np.float64)


def histograms(image: WorkingImage, points: Array) -> Floats:
    """Intensity histograms (N, 16), each of sum 1, of the discs around points (N, 2) in the image.

    Their parts outside `grey` repeat its edge.
    """
    grid = np.arange(-PATCH_RADIUS_PX, PATCH_RADIUS_PX + 1)
    dx, dy = (d.ravel() for d in np.meshgrid(grid, grid))
    disc = dx * dx + dy * dy <= (PATCH_RADIUS_PX + 0.5) ** 2
    near = np.rint(points).astype(np.int64)
    rows, columns = image.grey.shape
    x = np.clip(near[:, :1] + image.seam + dx[disc], 0, columns - 1)
    y = np.clip(near[:, 1:] + dy[disc], 0, rows - 1)
    bins = image.grey[y, x].astype(np.int64) * HISTOGRAM_BINS // 256 + HISTOGRAM_BINS * np.arange(len(points))[:, None]
    counts = np.bincount(bins.ravel(), minlength=HISTOGRAM_BINS * len(points)).reshape(-1, HISTOGRAM_BINS)
    return (counts / np.count_nonzero(disc)).astype(np.float32)


def track(before: Bytes, image: WorkingImage, points: Array, guesses: Array) -> tuple[Array, Bools]:
    """Tracks points (N, 2) of the image before: where they are now, and whether they were tracked: (N, 2) and (N,).

    Forward from `guesses` (N, 2) by Lucas and Kanade, and backward again: a point that does not come back is lost.
    """
    if not len(points):
        return points, np.zeros(0, np.bool_)
    seam = np.array([image.seam, 0])
    old = np.ascontiguousarray((points + seam)[:, None], np.float32)
    guess = np.ascontiguousarray((guesses + seam)[:, None], np.float32)
    options: dict[str, Any] = {
        "winSize": (WINDOW_PX, WINDOW_PX),
        "maxLevel": PYRAMID_LEVELS,
        "criteria": (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, 20, 0.02),
        "flags": cv2.OPTFLOW_USE_INITIAL_FLOW,
    }
    new, forward, _ = cv2.calcOpticalFlowPyrLK(before, image.grey, old, guess.copy(), **options)
    back_from = old + (new - guess)  # as far from the old place as the guess was from the new one
    again, backward, _ = cv2.calcOpticalFlowPyrLK(image.grey, before, new, back_from, **options)
    missed = np.linalg.norm((again - old)[:, 0], axis=1)
    found = new[:, 0].astype(np.float64) - seam
    if image.seam:
        found[:, 0] = np.mod(found[:, 0] + 0.5, image.columns) - 0.5
    kept = (forward.ravel() > 0) & (backward.ravel() > 0) & (missed <= MAX_FORWARD_BACKWARD_PX)
    return found, np.asarray(kept & image.inside(found, 2.0))


def find_again(
    image: WorkingImage, strength: Floats, expected: Array, histograms_before: Floats
) -> tuple[Array, Bools]:
    """Lost points (N, 2) around where they are `expected` (N, 2), and which were found (N,).

    Each is the local maximum of trackability around it whose histogram differs least from `histograms_before`
    (N, 16), if by little enough.
    """
    points, found = np.full_like(expected, np.nan), np.zeros(len(expected), np.bool_)
    peaks = strength >= cv2.dilate(strength, np.ones((3, 3), np.uint8))
    peaks &= strength > MIN_TRACKABILITY * strength.max()
    y, x = np.nonzero(peaks[:, image.seam : peaks.shape[1] - image.seam])
    if not len(x) or not len(expected):
        return points, found
    candidates = np.stack([x, y], axis=-1).astype(np.float64)
    gap = np.abs(candidates[None] - expected[:, None])
    if image.seam:
        gap[..., 0] = np.minimum(gap[..., 0], image.columns - gap[..., 0])
    with np.errstate(invalid="ignore"):
        close = np.hypot(gap[..., 0], gap[..., 1]) <= SEARCH_RADIUS_PX
    compared = np.flatnonzero(close.any(axis=0))
    if not len(compared):
        return points, found
    around = histograms(image, candidates[compared])
    difference = 0.5 * np.abs(around[None] - histograms_before[:, None]).sum(axis=2)
    difference = np.where(close[:, compared], difference, np.inf)
    best = np.argmin(difference, axis=1)
    found = difference[np.arange(len(expected)), best] <= MAX_HISTOGRAM_DIFFERENCE
    points[found] = candidates[compared][best[found]]
    return points, np.asarray(found)

"""Features of a local map in one picture after the other: tracked, lost, and found again.

Goedemé et al. 2007, sections 7.2.1 and 7.2.2: the point that can be tracked best close to a feature is followed (Shi
and Tomasi, Lucas and Kanade: OpenCV's); what was lost is looked for around where the local map says it must be, by the
histogram of its intensities, which does not change where a mirror's picture turns. Points are columns and rows without
the repeated ones of a `WorkingImage`.
"""

from typing import Any, cast

import cv2
import numpy as np
import numpy.typing as npt

from .working_image import Grey, WorkingImage

Array = npt.NDArray[np.float64]
Bools = npt.NDArray[np.bool_]
Floats = npt.NDArray[np.float32]
LEVELS = 16
"""Bins of an intensity histogram."""


def trackability(picture: WorkingImage) -> Floats:
    """The smaller eigenvalue of the gradients' matrix around each pixel of `grey` (equation 18): (rows, columns)."""
    return cast(Floats, cv2.cornerMinEigenVal(picture.grey, blockSize=5, ksize=3))


def best_nearby(strength: Floats, picture: WorkingImage, points: Array, reach: int) -> Array:
    """For points (N, 2) the most trackable pixels (N, 2) at most `reach` rows and columns away, if inside."""
    offsets = np.stack(np.meshgrid(np.arange(-reach, reach + 1), np.arange(-reach, reach + 1)), axis=-1).reshape(-1, 2)
    near = np.rint(points).astype(np.int64)[:, None, :] + offsets
    rows, columns = strength.shape
    x, y = near[..., 0] + picture.seam, near[..., 1]
    there = (x >= 0) & (x < columns) & (y >= 0) & (y < rows)
    found = np.where(there, strength[np.clip(y, 0, rows - 1), np.clip(x, 0, columns - 1)], -1.0)
    best: Array = near[np.arange(len(points)), np.argmax(found, axis=1)].astype(np.float64)
    return best


def histograms(picture: WorkingImage, points: Array, radius: int) -> Floats:
    """Intensity histograms (N, 16), each of sum 1, of the discs of `radius` pixels around points (N, 2) in the picture.

    Their parts outside `grey` repeat its edge.
    """
    grid = np.arange(-radius, radius + 1)
    dx, dy = (d.ravel() for d in np.meshgrid(grid, grid))
    disc = dx * dx + dy * dy <= (radius + 0.5) ** 2
    near = np.rint(points).astype(np.int64)
    rows, columns = picture.grey.shape
    x = np.clip(near[:, :1] + picture.seam + dx[disc], 0, columns - 1)
    y = np.clip(near[:, 1:] + dy[disc], 0, rows - 1)
    bins = picture.grey[y, x].astype(np.int64) * LEVELS // 256 + LEVELS * np.arange(len(points))[:, None]
    counts = np.bincount(bins.ravel(), minlength=LEVELS * len(points)).reshape(-1, LEVELS)
    return (counts / np.count_nonzero(disc)).astype(np.float32)


def track(
    before: Grey, picture: WorkingImage, points: Array, guesses: Array, window: int, levels: int, agreed: float
) -> tuple[Array, Bools]:
    """Where points (N, 2) of the picture before are now, and whether they were followed: (N, 2) and (N,).

    Forth from `guesses` (N, 2) by Lucas and Kanade in windows of `window` pixels over `levels` halvings, and back
    again: who does not come back within `agreed` pixels is lost.
    """
    if not len(points):
        return points, np.zeros(0, np.bool_)
    seam = np.array([picture.seam, 0])
    old = np.ascontiguousarray((points + seam)[:, None], np.float32)
    guess = np.ascontiguousarray((guesses + seam)[:, None], np.float32)
    how: dict[str, Any] = {
        "winSize": (window, window),
        "maxLevel": levels,
        "criteria": (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, 20, 0.02),
        "flags": cv2.OPTFLOW_USE_INITIAL_FLOW,
    }
    new, forth, _ = cv2.calcOpticalFlowPyrLK(before, picture.grey, old, guess.copy(), **how)
    back_from = old + (new - guess)  # as far from the old place as the guess was from the new one
    again, back, _ = cv2.calcOpticalFlowPyrLK(picture.grey, before, new, back_from, **how)
    missed = np.linalg.norm((again - old)[:, 0], axis=1)
    found = new[:, 0].astype(np.float64) - seam
    if picture.seam:
        found[:, 0] = np.mod(found[:, 0] + 0.5, picture.columns) - 0.5
    kept = (forth.ravel() > 0) & (back.ravel() > 0) & (missed <= agreed) & picture.inside(found, 2.0)
    return found, np.asarray(kept)


def find_again(
    picture: WorkingImage,
    strength: Floats,
    expected: Array,
    looks: Floats,
    reach: float,
    radius: int,
    alike: float,
    quality: float,
) -> tuple[Array, Bools]:
    """Lost features (N,) by what they looked like, around where they are `expected` (N, 2): points (N, 2) and who (N,).

    Of the local maxima of trackability at most `reach` pixels away, and above `quality` of the picture's strongest, the
    one whose histogram differs least from `looks` (N, 16), if by at most `alike` (half the sum of differences, 0 to 1).
    """
    found, who = np.full_like(expected, np.nan), np.zeros(len(expected), np.bool_)
    peaks = (strength >= cv2.dilate(strength, np.ones((3, 3), np.uint8))) & (strength > quality * strength.max())
    y, x = np.nonzero(peaks[:, picture.seam : peaks.shape[1] - picture.seam])
    if not len(x) or not len(expected):
        return found, who
    candidates = np.stack([x, y], axis=-1).astype(np.float64)
    apart = np.abs(candidates[None] - expected[:, None])
    if picture.seam:
        apart[..., 0] = np.minimum(apart[..., 0], picture.columns - apart[..., 0])
    with np.errstate(invalid="ignore"):
        near = np.hypot(apart[..., 0], apart[..., 1]) <= reach
    asked = np.flatnonzero(near.any(axis=0))
    if not len(asked):
        return found, who
    differs = 0.5 * np.abs(histograms(picture, candidates[asked], radius)[None] - looks[:, None]).sum(axis=2)
    differs = np.where(near[:, asked], differs, np.inf)
    best = np.argmin(differs, axis=1)
    who = differs[np.arange(len(expected)), best] <= alike
    found[who] = candidates[asked][best[who]]
    return found, np.asarray(who)

"""The ring that a mirror of which nothing is known leaves in its image: found by its two circles."""

from typing import cast

import cv2
import numpy as np

from omninav.stages.geometry.arrays import Array, Floats
from omninav.stages.values.image import Pixels

from .model import Ring


class RingNotFound(ValueError):
    """No ring is found in the image."""


MIN_SCORE = 1.0
"""Score below which no ring was found. Over 27 images of three real and rendered mirrors rings score 1.03 to 1.37;
parts of these images without a whole ring, panoramas and noise score 0.49 to 0.99."""
RAYS = 90
"""Rays from a centre along which edges are looked for."""


def radial_edges(grey: Floats, centre: tuple[float, float], radii: int) -> Array:
    """Share of a circle that is an edge, per radius in whole pixels: (radii,) in [0, 1].

    A ray counts at a radius where the step of brightness across it is large against the steps around it (a tenth of the
    image along the ray, and the rays beside it). So a faint rim between a plain wall and its plain reflection counts
    as much as one before a bright window, and a crowded part of the image counts little anywhere. Circles may leave
    the image with up to 40 percent of their length.
    """
    angle = 2 * np.pi * np.arange(RAYS)[:, None] / RAYS
    u = (centre[0] + np.arange(radii) * np.cos(angle)).astype(np.float32)
    v = (centre[1] + np.arange(radii) * np.sin(angle)).astype(np.float32)
    polar_grey = cv2.remap(grey, u, v, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    step = np.abs(np.diff(polar_grey, axis=1, append=polar_grey[:, -1:]))
    inside = (u >= 0) & (u <= grey.shape[1] - 1) & (v >= 0) & (v <= grey.shape[0] - 1)
    around = cv2.blur(step, (max(grey.shape) // 10 | 1, 3), borderType=cv2.BORDER_REFLECT)
    strength = np.where(inside, step / (step + 2.0 * around + 0.3), 0.0)
    return np.asarray(strength.sum(axis=0) / np.maximum(inside.sum(axis=0), 0.6 * RAYS))


def find_ring(pixels: Pixels) -> Ring:
    """Centre and radii of the mirror's ring in an image; raises RingNotFound where there is none.

    The ring is the pair of circles around one centre near the image's middle that are edges over most of their
    length: the mirror's rim, and, within 45 percent of it, the camera's own reflection. That they share a centre is
    what tells them from the round things in the scene.
    """
    height, width = pixels.shape[:2]
    scale = max(1.0, max(height, width) / 240.0)
    small = cv2.resize(pixels, None, fx=1.0 / scale, fy=1.0 / scale, interpolation=cv2.INTER_AREA)
    grey = cast(Floats, cv2.cvtColor(small, cv2.COLOR_BGR2GRAY).astype(np.float32))
    h, w = grey.shape
    smallest, largest = int(0.28 * min(h, w)), int(0.62 * min(h, w))
    outer_radii = np.arange(smallest, largest - 2)
    low, high = max(2, int(0.06 * smallest)), (0.45 * outer_radii).astype(int)
    centre, best, inner, outer = (w / 2.0, h / 2.0), -1.0, 0, 0
    span, step = 0.16 * min(h, w), 0.02 * min(h, w)
    while step > 0.2:
        # Blurred as wide as the step, so that the right circle is seen from the nearest centre that is tried.
        blurred = cast(Floats, cv2.GaussianBlur(grey, (0, 0), max(1.0, 0.7 * step)))
        middle, best = centre, -1.0
        offsets = np.arange(-span, span + step / 2, step)
        for dy in offsets:
            for dx in offsets:
                candidate = (middle[0] + float(dx), middle[1] + float(dy))
                edges = radial_edges(blurred, candidate, largest)
                within = np.maximum.accumulate(np.concatenate([np.zeros(low), edges[low:]]))
                scores = edges[outer_radii] + within[high]
                at = int(np.argmax(scores))
                if scores[at] > best:
                    best, centre, outer = float(scores[at]), candidate, int(outer_radii[at])
                    inner = low + int(np.argmax(edges[low : high[at] + 1]))
        span, step = 1.5 * step, step / 3
    if best < MIN_SCORE:
        raise RingNotFound("no ring is found")
    # Half a pixel of the small image within the rim, and outside of the camera's reflection.
    return Ring(
        (centre[0] + 0.5) * scale - 0.5, (centre[1] + 0.5) * scale - 0.5, (inner + 1.5) * scale, (outer - 0.5) * scale
    )

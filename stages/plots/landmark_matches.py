"""The features of an image that were matched to landmarks, drawn on it."""

import numpy as np

from omninav.stages.values.thumbnails import decoded, encoded

from .draw_homing import disc
from .panorama_snapshot import QUALITY, EncodedPanorama

AGREEING, OTHER = (80, 230, 0), (0, 94, 255)
"""Green and orange (blue-green-red), bright enough on images: features that agree with the pose, and the others."""
RADIUS_PX = 1.25
"""Radius of a feature's dot."""
COLOURS = "Dots in the image are features that were matched to landmarks: green where they agree with the pose."
"""Sentence of the caption that names the colours."""


def drawn_matches(snapshot: EncodedPanorama) -> bytes:
    """JPEG bytes of the image with its matched features; the image as it is where there are none."""
    if snapshot.points is None or snapshot.agree is None or not len(snapshot.points):
        return snapshot.jpeg
    pixels = decoded(snapshot.jpeg).copy()
    for agreeing, colour in ((False, OTHER), (True, AGREEING)):
        chosen = (snapshot.agree == agreeing) & np.isfinite(snapshot.points).all(axis=1)
        for x, y in snapshot.points[chosen].tolist():
            disc(pixels, (x, y), RADIUS_PX, colour)
    return encoded(pixels, QUALITY)


def match_facts(snapshot: EncodedPanorama | None) -> list[tuple[str, str]]:
    """The number of matched features that agree with the pose, in words."""
    if snapshot is None or snapshot.agree is None:
        return []
    return [("landmarks", f"{int(snapshot.agree.sum())} of {len(snapshot.agree)} matches agree")]

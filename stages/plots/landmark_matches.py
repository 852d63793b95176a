"""The features of an image that were taken for landmarks, drawn on it."""

import cv2
import numpy as np

from omninav.stages.values.thumbnails import decoded

from .panorama_snapshot import QUALITY, EncodedPanorama

AGREEING, OTHER = (80, 230, 0), (0, 94, 255)
"""Green and orange (blue-green-red), bright enough on images: features that agree with the pose, and the others."""
RADIUS_16THS = 20
"""Radius of a feature's dot, sixteenths of a pixel."""
COLOURS = "Dots in the image are features that were taken for landmarks: green where they agree with the pose."
"""Sentence of the caption that names the colours."""


def drawn_matches(snapshot: EncodedPanorama) -> bytes:
    """JPEG bytes of the image with its matched features; the image as it is where there are none."""
    if snapshot.points is None or snapshot.agree is None or not len(snapshot.points):
        return snapshot.jpeg
    pixels = decoded(snapshot.jpeg).copy()
    for agreeing, colour in ((False, OTHER), (True, AGREEING)):
        chosen = (snapshot.agree == agreeing) & np.isfinite(snapshot.points).all(axis=1)
        for x, y in np.round(snapshot.points[chosen] * 16).astype(np.int64).tolist():
            cv2.circle(pixels, (x, y), RADIUS_16THS, colour, cv2.FILLED, cv2.LINE_AA, 4)
    return cv2.imencode(".jpg", pixels, [cv2.IMWRITE_JPEG_QUALITY, QUALITY])[1].tobytes()


def match_facts(snapshot: EncodedPanorama | None) -> list[tuple[str, str]]:
    """The number of matched features that agree with the pose, in words."""
    if snapshot is None or snapshot.agree is None:
        return []
    return [("landmarks", f"{int(snapshot.agree.sum())} of {len(snapshot.agree)} matches agree")]

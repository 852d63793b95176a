"""The image of the reference that looks most like the present image, turned as the robot is turned against it."""

import math
from collections.abc import Sequence

import cv2
import numpy as np

from omninav.stages.values.image import Pixels
from omninav.stages.values.map_places import AnyMap
from omninav.stages.values.thumbnails import Thumbnails, decoded
from omninav.stages.values.topological_map import TopologicalMap
from omninav.stages.values.view_mixtures import ViewEvent

from .panorama_snapshot import EncodedPanorama

COLUMNS = 240
"""Width of a picture, pixels: a page holds one for each of its frames."""


def first_seen(events: Sequence[ViewEvent | None]) -> dict[int, int]:
    """The tick in which each view that a map learned was seen, by the view's id."""
    return {
        view: tick
        for event in events
        if event is not None
        for view, tick in zip(event.inserted.tolist(), event.seen.tolist(), strict=True)
    }


def picture_of_reference(
    reference: int, turn: float, map: AnyMap | None, thumbnails: Thumbnails | None
) -> bytes | None:
    """JPEG bytes of a reference's thumbnail, or of a place's; None where there is none. `turn`: rad, the robot's."""
    image = int(map.places[reference]) if isinstance(map, TopologicalMap) else int(reference)
    if thumbnails is None or image >= len(thumbnails) or thumbnails.ends[image] == thumbnails.ends[image + 1]:
        return None
    return _turned(thumbnails.image(image), turn)


def picture_of_view(panorama: EncodedPanorama | None, turn: float) -> bytes | None:
    """JPEG bytes of an image of the drive itself; None where none was kept. `turn`: rad, the robot's against it."""
    if panorama is None:
        return None
    pixels = decoded(panorama.jpeg)
    if pixels.shape[1] > COLUMNS:
        size = COLUMNS, max(1, round(pixels.shape[0] * COLUMNS / pixels.shape[1]))
        pixels = np.asarray(cv2.resize(pixels, size, interpolation=cv2.INTER_AREA), np.uint8)
    return _turned(pixels, 0.0 if panorama.headings else turn)


def _turned(pixels: Pixels, turn: float) -> bytes:
    if pixels.shape[1] > 2 * pixels.shape[0]:  # a panorama, not a mirror's disc
        columns = round(float(np.nan_to_num(turn)) / (2 * math.pi) * pixels.shape[1])
        pixels = np.roll(pixels, columns, axis=1)
    return cv2.imencode(".jpg", pixels, [cv2.IMWRITE_JPEG_QUALITY, 80])[1].tobytes()

"""The image of the reference that looks most like the present image, turned as the robot is turned against it."""

import math
from collections.abc import Sequence

import numpy as np

from omninav.stages.camera.thumbnail import thumbnail
from omninav.stages.values.image import Pixels
from omninav.stages.values.map_places import AnyMap
from omninav.stages.values.thumbnails import Thumbnails, decoded, encoded
from omninav.stages.values.topological_map import TopologicalMap
from omninav.stages.values.view_mixtures import ViewEvent

from .panorama_snapshot import EncodedPanorama
from .target_images import image_of

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
    pixels = image_of(int(map.places[reference]) if isinstance(map, TopologicalMap) else reference, thumbnails)
    return None if pixels is None else _turned(pixels, turn)


def picture_of_view(panorama: EncodedPanorama | None, turn: float) -> bytes | None:
    """JPEG bytes of an image of the drive itself; None where none was kept. `turn`: rad, the robot's against it."""
    if panorama is None:
        return None
    pixels = thumbnail(decoded(panorama.jpeg), None, COLUMNS).pixels
    return _turned(pixels, 0.0 if panorama.headings else turn)


def _turned(pixels: Pixels, turn: float) -> bytes:
    if pixels.shape[1] > 2 * pixels.shape[0]:  # a panorama, not a mirror's disc
        columns = round(float(np.nan_to_num(turn)) / (2 * math.pi) * pixels.shape[1])
        pixels = np.roll(pixels, columns, axis=1)
    return encoded(pixels)

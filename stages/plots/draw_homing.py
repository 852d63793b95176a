"""Draws tracked features by their state, and the homing vector over the floor, into images."""

import cv2
import numpy as np
import numpy.typing as npt

from omninav.stages.geometry.arrays import Floats, Shorts
from omninav.stages.values.homing import FOUND_AGAIN, LOST, MATCHED, TRACKED, HomingVector
from omninav.stages.values.image import Pixels

from .homing_snapshot import EncodedHomingView

Colour = tuple[int, int, int]
BRIGHT: dict[int, Colour] = {
    LOST: (0, 94, 255),
    TRACKED: (255, 200, 60),
    FOUND_AGAIN: (60, 235, 250),
    MATCHED: (110, 235, 90),
}
"""Blue-green-red, of Okabe & Ito's hues, brighter: they are drawn over photographs."""
UNUSED: Colour = (225, 225, 225)
VECTOR: Colour = (0, 159, 255)
DARK: Colour = (25, 25, 25)
FINE = 4
"""Bits of a pixel's fraction that OpenCV draws with."""


def is_known(vector: HomingVector) -> bool:
    """Tells whether a homing vector is known: it is not where the target was never found."""
    return vector.state != "lost" or vector.metres is not None or vector.direction != 0.0


def draw_robot_view(pixels: Pixels, snapshot: EncodedHomingView) -> Pixels:
    """The robot's image with its tracked features and the homing vector. As large as `pixels`."""
    drawn, scale = pixels.copy(), pixels.shape[1] / snapshot.size[0]
    _features(drawn, snapshot.points * scale, snapshot.kinds)
    line = snapshot.floor_line[np.isfinite(snapshot.floor_line).all(axis=1)] * scale
    if snapshot.vector is not None and len(line) > 1 and is_known(snapshot.vector):
        lost = not snapshot.vector.is_found
        colour = BRIGHT[LOST] if lost else VECTOR
        for shade, thick in ((DARK, 6), (colour, 3)):
            polyline(drawn, line, shade, thick)
            arrow_head(drawn, line[-1], line[-1] - line[max(0, len(line) - 4)], shade, 11.0 if thick == 3 else 14.0)
    return drawn


def draw_target_view(pixels: Pixels | None, snapshot: EncodedHomingView, size: tuple[int, int]) -> Pixels:
    """The target view, with the same features in the same colours; the others light. Grey without its image.

    `size`: columns and rows.
    """
    columns, rows = size
    drawn = np.full((rows, columns, 3), 90, np.uint8)
    if pixels is not None:
        drawn = np.asarray(cv2.resize(pixels, size, interpolation=cv2.INTER_AREA), np.uint8)
    scale = columns / snapshot.size[0]
    unused = snapshot.target_kinds < 0
    for x, y in _finite(snapshot.target_points[unused]) * scale:
        disc(drawn, (x, y), 1.5, UNUSED)
    _features(drawn, snapshot.target_points[~unused] * scale, snapshot.target_kinds[~unused])
    return drawn


def _features(drawn: Pixels, points: Floats, kinds: npt.NDArray[np.int8]) -> None:
    size = float(np.clip(drawn.shape[1] / 120, 1.8, 3.5))
    for kind in (LOST, MATCHED, FOUND_AGAIN, TRACKED):
        for x, y in _finite(points[kinds == kind]):
            if kind == LOST:
                for side in (-size, size):
                    polyline(drawn, [(x - size, y - side), (x + size, y + side)], BRIGHT[kind], 1)
            else:
                disc(drawn, (x, y), size + 1.0, DARK)
                disc(drawn, (x, y), size, BRIGHT[kind])


def _finite(points: Floats) -> Floats:
    kept: Floats = points[np.isfinite(points).all(axis=1)]
    return kept


def fixed(points: npt.ArrayLike) -> Shorts:
    """Points in OpenCV's fixed-point pixels."""
    whole: Shorts = np.round(np.asarray(points, np.float64) * 2**FINE).astype(np.int32)
    return whole


def polyline(drawn: Pixels, points: npt.ArrayLike, colour: Colour, thickness: int) -> None:
    """A smooth line through points (N, 2)."""
    cv2.polylines(drawn, [fixed(points).reshape(-1, 1, 2)], False, colour, thickness, cv2.LINE_AA, FINE)


def disc(drawn: Pixels, centre: tuple[float, float], radius: float, colour: Colour) -> None:
    """A smooth disc."""
    x, y = fixed(centre).tolist()
    cv2.circle(drawn, (x, y), round(radius * 2**FINE), colour, cv2.FILLED, cv2.LINE_AA, FINE)


def arrow_head(drawn: Pixels, tip: Floats, along: Floats, colour: Colour, size: float) -> None:
    """A triangle that points along a direction."""
    length = float(np.hypot(*along))
    if length == 0.0:
        return
    ahead = np.asarray(along, np.float64) / length * size
    side = np.array([-ahead[1], ahead[0]]) * 0.55
    corners = [tip + 0.4 * ahead, tip - 0.6 * ahead + side, tip - 0.6 * ahead - side]
    cv2.fillPoly(drawn, [fixed(corners)], colour, cv2.LINE_AA, FINE)

"""Keeps small images of a drive by homing, because images themselves are too large to be kept."""

import math

import numpy as np
import numpy.typing as npt

from omninav.pipeline import Context, Outputs, Stage, Tick, Value
from omninav.stages.camera.equirectangular import camera_behind
from omninav.stages.camera.model import Camera, seen_at
from omninav.stages.camera.thumbnail import thumbnail
from omninav.stages.geometry.arrays import Array, Floats
from omninav.stages.values.homing import HomingTarget, HomingVector, TrackedFeatures
from omninav.stages.values.image import Image, Panorama

from .snapshot_times import is_snapshot_frame

COLUMNS = 480
"""Largest width of a kept image, pixels."""
NEAREST_M, MIN_LENGTH_M, MAX_LENGTH_M, UNKNOWN_LENGTH_M = 0.35, 0.7, 6.0, 1.5
"""Start of a homing vector on the floor, its least and greatest length, and its length where that is unknown (m)."""


class EncodedHomingView(Value):
    """An image as JPEG bytes, with the state of homing. Points are columns and rows of that image of `size`.

    `points`, `kinds` (N,): as in `TrackedFeatures`. `floor_line` (K, 2): the floor along the homing vector, from
    the robot on; it ends at the target where `metres` are known. `target_points` (M, 2): the target's features in a
    image of this size that was taken there; `target_kinds` (M,): their kinds, -1 for those that are not followed.
    NaN where a point is not seen. `vector`: None where there is no target.
    """

    jpeg: bytes
    size: tuple[int, int]
    points: Floats
    kinds: npt.NDArray[np.int8]
    floor_line: Floats
    target_points: Floats
    target_kinds: npt.NDArray[np.int8]
    target: str = ""
    vector: HomingVector | None = None


class HomingSnapshot(Stage):
    """Keeps at even steps a small JPEG of the robot's image (quality 80) with the state of homing.

    A mirror's or a fisheye's image is cut to its disc. Without a target the image alone is kept.
    """

    class Out(Outputs):
        """`snapshot`: absent in between."""

        snapshot: EncodedHomingView | None = None

    def step(
        self,
        ctx: Context,
        tick: Tick,
        image: Image | Panorama,
        camera: Camera | None = None,
        target: HomingTarget | None = None,
        vector: HomingVector | None = None,
        tracks: TrackedFeatures | None = None,
    ) -> Out:
        if not is_snapshot_frame(tick.frame):
            return self.Out()
        small = thumbnail(image.pixels, camera, COLUMNS)
        points, floor_line, there = np.zeros((0, 2)), np.zeros((0, 2)), np.zeros((0, 2))
        kinds, of_target = np.zeros(0, np.int64), np.zeros(0, np.int8)
        if tracks is not None:
            points, kinds = tracks.points, tracks.kinds
        seen_by = camera_behind(image, camera)
        if vector is not None and seen_by is not None:
            floor_line = seen_at(seen_by, floor_ahead(vector, None if camera is None else camera.height))
        if target is not None:
            rays = target.features.point_bearings()
            there = np.full((len(rays), 2), np.nan) if seen_by is None else seen_at(seen_by, rays)
            of_target = np.full(len(there), -1, np.int8)
            if tracks is not None:
                of_target[tracks.rows] = tracks.kinds
        snapshot = EncodedHomingView(
            small.jpeg(80),
            (small.pixels.shape[1], small.pixels.shape[0]),
            small.points(points),
            kinds.astype(np.int8),
            small.points(floor_line),
            small.points(there),
            of_target,
            "" if target is None else target.name,
            vector,
        )
        return self.Out(snapshot=snapshot)


def floor_ahead(vector: HomingVector, height: float | None) -> Array:
    """Points (K, 3) of the floor along a homing vector (m, robot frame, from the camera), `height` below it (1 m)."""
    length = UNKNOWN_LENGTH_M if vector.metres is None else min(max(vector.metres, MIN_LENGTH_M), MAX_LENGTH_M)
    metres = np.linspace(NEAREST_M, length, 24)
    below = np.full(len(metres), -(height or 1.0))
    return np.stack([metres * math.cos(vector.direction), metres * math.sin(vector.direction), below], axis=-1)
